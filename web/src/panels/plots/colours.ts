/** Colours of lines that people with any colour vision can distinguish (Okabe and Ito, 2008). */
const COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#b8a800"];

export function colourOf(i: number): string {
  return COLOURS[i % COLOURS.length]!;
}
