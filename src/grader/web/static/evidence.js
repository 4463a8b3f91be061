// The measurements behind a verdict, as pictures.

export function evidenceFigures(evidence) {
  return [];
}
