// Colours of the style sheet `colours.css`, which all pages share.

const CURVES = 8;
const dark = matchMedia("(prefers-color-scheme: dark)");

/** The colour of curve or vehicle number `index`. */
export function curveColour(index) {
  return pageColour(`curve-${index % CURVES}`);
}

/** A colour of the style sheet, such as `ink`. */
export function pageColour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** Calls `change` when the page becomes light or dark. */
export function onTheme(change) {
  dark.addEventListener("change", change);
}
