// Size of the tiles of the overview, such that all axes fit on one screen if possible.

export interface Layout {
  columns: number;
  /** Names of parameters with their numbers, or only bars. */
  wide: boolean;
  /** Height of a bar [px]. */
  bar: number;
  /** Magnification of everything in a tile. */
  zoom: number;
}

export const GAP = 4;
const WIDE = 250;
const LARGEST = 520;
const SMALLEST = 74;
const READABLE = 130; // the name of an axis, beside its mark
const NEARLY = 1.25; // screens
const FEW = 24;
const PHONE = 700;
const WALL = 1800;
const ZOOMS = [2, 1.5];

const heightOf = (wide: boolean, parameters: number): number => (wide ? 74 + 36 * parameters : 27 + 9 * parameters);

/** The layout for a number of axes, with at most so many parameters each, in an area of this size [px]. */
export function layoutOf(axes: number, parameters: number, width: number, height: number): Layout {
  // On a phone the page scrolls anyway: a few axes show all their numbers.
  if (axes <= FEW && width < PHONE) return { columns: Math.max(1, Math.floor(width / WIDE)), wide: true, bar: 14, zoom: 1 };
  // On a large wall screen, which is read from a distance, a few axes are larger.
  for (const zoom of width < WALL ? [] : ZOOMS) {
    const found = fitted(axes, parameters, width / zoom, height / zoom);
    if (found?.wide) return { ...found, zoom };
  }
  const found = fitted(axes, parameters, width, height);
  if (found) return found;
  // They do not fit, so that the page scrolls: a few with all numbers, many as small tiles with readable names.
  if (axes <= FEW) return { columns: Math.max(1, Math.floor(width / (WIDE + 40))), wide: true, bar: 14, zoom: 1 };
  const most = mostColumns(width);
  const nearly = Math.ceil(axes / most) * (heightOf(false, parameters) + GAP) <= NEARLY * height;
  return { columns: nearly ? most : Math.max(1, Math.floor((width + GAP) / (READABLE + GAP))), wide: false, bar: 6, zoom: 1 };
}

const mostColumns = (width: number): number => Math.max(1, Math.floor((width + GAP) / (SMALLEST + GAP)));

/** Null: they do not fit. */
function fitted(axes: number, parameters: number, width: number, height: number): Layout | null {
  for (let columns = Math.max(1, Math.ceil(width / LARGEST)); columns <= mostColumns(width); columns += 1) {
    const tile = (width + GAP) / columns - GAP;
    const wide = tile >= WIDE;
    const rows = Math.ceil(axes / columns);
    const room = (height + GAP) / rows - GAP;
    if (heightOf(wide, parameters) <= room) {
      const bar = wide ? 14 : Math.min(16, Math.floor((room - 27) / parameters) - 3);
      return { columns, wide, bar: Math.max(6, bar), zoom: 1 };
    }
  }
  return null;
}
