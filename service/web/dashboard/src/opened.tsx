// A panel that a button opens.
import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";

/** Its content is made and requested only while it is open. */
export function Opened({ title, children }: { title: string; children: ComponentChildren }) {
  const [open, set] = useState(false);
  return (
    <section class="panel" aria-label={title}>
      <h2 class="opener"><button type="button" aria-expanded={open} onClick={() => set(!open)}>{open ? "▾" : "▸"} {title}</button></h2>
      {open && children}
    </section>
  );
}
