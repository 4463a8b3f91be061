// The floor: mj_step in a loop with nothing around it.
#include <mujoco/mujoco.h>

void step_loop(const mjModel* model, mjData* data, int steps) {
  for (int step = 0; step < steps; step++) {
    mj_step(model, data);
  }
}
