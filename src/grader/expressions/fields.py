"""The fields of the model, its options and the data that expressions may name: the allow-list. A field that is not
listed does not exist for an expression. Fields that hold addresses, types or sizes are read-only: MuJoCo trusts them,
and a wrong one would make it read outside its memory. Arrays that move during a run (`efc_*`, `contact`) are left out;
`lib` gives what labs need of them. Source: https://mujoco.readthedocs.io/en/stable/APIreference/APItypes.html (mjModel,
mjOption, mjData)."""


def split_names(text: str) -> frozenset[str]:
    """Returns the words of a text."""
    return frozenset(text.split())


MODEL_SIZES = split_names("""
    nq nv nu na nbody njnt ngeom nsite ncam nlight nmesh ntendon neq npair nexclude nsensor nsensordata nkey nmocap
    nuserdata nnumeric
""")
"""Whole numbers that a compiled model never changes."""

MODEL_PARAMETERS = split_names("""
    qpos0 qpos_spring body_pos body_quat body_ipos body_iquat body_mass body_inertia body_gravcomp jnt_pos jnt_axis
    jnt_stiffness jnt_range jnt_margin jnt_limited jnt_solref jnt_solimp jnt_actfrcrange dof_damping dof_armature
    dof_frictionloss dof_solref dof_solimp geom_pos geom_quat geom_size geom_friction geom_margin geom_gap geom_solmix
    geom_solref geom_solimp geom_fluid geom_rgba geom_contype geom_conaffinity geom_group site_pos site_quat site_size
    site_rgba pair_friction pair_solref pair_solimp pair_margin pair_gap eq_active0 eq_data eq_solref eq_solimp
    tendon_range tendon_limited tendon_margin tendon_stiffness tendon_damping tendon_armature tendon_frictionloss
    tendon_lengthspring tendon_solref_lim tendon_solimp_lim tendon_rgba actuator_gainprm actuator_biasprm
    actuator_dynprm actuator_gear actuator_ctrlrange actuator_ctrllimited actuator_forcerange actuator_forcelimited
    actuator_damping actuator_armature key_qpos key_qvel key_act key_ctrl key_mpos key_mquat key_time mat_rgba
    sensor_noise numeric_data
""")
"""Arrays of the model that may be written."""

MODEL_FIXED = split_names("""
    body_parentid body_rootid body_weldid body_mocapid body_jntnum body_jntadr body_dofnum body_dofadr body_geomnum
    body_geomadr body_subtreemass body_invweight0 jnt_type jnt_qposadr jnt_dofadr jnt_bodyid dof_bodyid dof_jntid
    dof_parentid dof_M0 dof_invweight0 geom_type geom_bodyid geom_condim geom_priority geom_rbound geom_aabb site_type
    site_bodyid eq_type eq_obj1id eq_obj2id tendon_length0 tendon_invweight0 actuator_trntype actuator_dyntype
    actuator_gaintype actuator_biastype actuator_trnid actuator_acc0 actuator_length0 actuator_lengthrange sensor_type
    sensor_adr sensor_dim sensor_objid numeric_adr numeric_size
""")
"""Arrays of the model that can only be read."""

DATA_STATE = split_names("""
    qpos qvel act ctrl qfrc_applied xfrc_applied eq_active mocap_pos mocap_quat qacc_warmstart userdata
""")
"""Arrays of the data that may be written."""

DATA_RESULTS = split_names("""
    qacc qacc_smooth act_dot energy sensordata xpos xquat xmat xipos ximat xanchor xaxis geom_xpos geom_xmat site_xpos
    site_xmat cam_xpos cam_xmat light_xpos subtree_com subtree_linvel subtree_angmom cvel cacc cfrc_int cfrc_ext cdof
    cinert ten_length ten_velocity actuator_length actuator_velocity actuator_force qfrc_bias qfrc_passive qfrc_spring
    qfrc_damper qfrc_gravcomp qfrc_fluid qfrc_actuator qfrc_smooth qfrc_constraint qfrc_inverse
""")
"""Arrays of the data that can only be read."""

DATA_COUNTS = split_names("ncon nefc ne nf nl nisland")
"""Whole numbers of the data, which change in a run."""

CTX_FORBIDDEN = split_names("""
    constructor prototype toString valueOf hasOwnProperty isPrototypeOf propertyIsEnumerable toLocaleString caller
    callee arguments
""")
"""Names of `ctx` that mean something else in JavaScript; so do those that begin with two underscores."""

OPTION_VECTORS = split_names("gravity wind magnetic o_solref o_solimp o_friction")
"""Arrays of model.opt, which may be written."""

OPTION_SCALARS: dict[str, tuple[float, float]] = {
    "timestep": (1e-6, 10),
    "integrator": (0, 4),
    "cone": (0, 1),
    **dict.fromkeys(split_names("jacobian solver"), (0, 2)),
    **dict.fromkeys(split_names("iterations ls_iterations noslip_iterations ccd_iterations"), (0, 1000)),
    **dict.fromkeys(split_names("tolerance ls_tolerance noslip_tolerance ccd_tolerance"), (0, 1)),
    "impratio": (1e-6, 1e6),
    **dict.fromkeys(split_names("density viscosity"), (0, 1e6)),
    "o_margin": (-1e3, 1e3),
    **dict.fromkeys(split_names("disableflags enableflags disableactuator"), (0, 2**31 - 1)),
}
"""Name: smallest and largest value that may be written; beyond some of them MuJoCo aborts or a step never ends."""
