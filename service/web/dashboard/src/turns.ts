// Draws many items in turns, some in each frame of the screen: style, layout and paint of all of them at
// once would keep the page from answering to keys.
import { useEffect, useRef, useState } from "preact/hooks";

const AT_ONCE = 20;

/** The items to draw, by name; if there are only a few, they are drawn at once. */
export function useInTurns<T>(items: T[], nameOf: (item: T) => string, same: (a: T, b: T) => boolean): Map<string, T> {
  const drawn = useRef(new Map<string, T>());
  const [, redraw] = useState(0);
  const few = items.length <= AT_ONCE;
  useEffect(() => {
    if (few) return undefined;
    let frame = 0;
    const turn = (): void => {
      const left = items.filter((item) => {
        const before = drawn.current.get(nameOf(item));
        return before === undefined || !same(before, item);
      });
      if (left.length === 0) return;
      for (const item of left.slice(0, AT_ONCE)) drawn.current.set(nameOf(item), item);
      redraw((n) => n + 1);
      frame = requestAnimationFrame(turn);
    };
    frame = requestAnimationFrame(turn);
    return () => cancelAnimationFrame(frame);
  }, [items, few]);
  if (few) drawn.current = new Map(items.map((item) => [nameOf(item), item]));
  return drawn.current;
}
