// Colours of the page: those of the style sheet, and two scales that most colour-blind people read.

// Okabe and Ito, without black and yellow, which vanish on a dark or a light ground.
export const MATCHES = ['#56b4e9', '#e69f00', '#009e73', '#d55e00', '#cc79a7', '#0072b2', '#f0e442'];

// The colour of the style sheet's variable `name`.
export const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Some colours of the scale cividis (Nuñez, Anderton, Renslow, 2018), from low to high, red, green, blue.
const CIVIDIS = [[0, 34, 78], [44, 61, 109], [87, 93, 109], [125, 124, 120], [165, 156, 116], [211, 193, 100], [254, 232, 56]];

// The colour at `share` (0 to 1) of the scale.
export function scale(share) {
  const at = Math.min(Math.max(share, 0), 1) * (CIVIDIS.length - 1);
  const low = Math.min(Math.floor(at), CIVIDIS.length - 2);
  return CIVIDIS[low].map((value, i) => Math.round(value + (at - low) * (CIVIDIS[low + 1][i] - value)));
}

// Where `value` lies between two positive ends, by its logarithm.
export const share = (value, low, high) => Math.log(value / low) / Math.log(high / low);
