// Colours: of curves, those of Okabe and Ito, which differ without colour vision, too; of the page, its style sheet's.

const CURVES_LIGHT = ["#0072b2", "#d55e00", "#009e73", "#b8508c", "#a87b00", "#3b97c9", "#6b4fa0", "#4d4d4d"];
const CURVES_DARK = ["#56b4e9", "#ff8c42", "#2fc79a", "#e08fbf", "#f0c23a", "#9ad0f5", "#b8a1ee", "#c9c9c9"];
const dark = matchMedia("(prefers-color-scheme: dark)");

/** The colour of curve or vehicle number `index`. */
export function curveColour(index) {
  const colours = dark.matches ? CURVES_DARK : CURVES_LIGHT;
  return colours[index % colours.length];
}

/** A colour of the style sheet, such as `ink`. */
export function pageColour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** Calls `change` when the page becomes light or dark. */
export function onTheme(change) {
  dark.addEventListener("change", change);
}
