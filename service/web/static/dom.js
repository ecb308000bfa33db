// Elements. Text only ever becomes a text node, so nothing that comes from the daemon is read as HTML.

/** An element with properties and children; `data` and `aria...` become attributes. */
export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in node && name !== "role") node[name] = value;
    else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

/** Sets text where it differs: an unchanged page stays still, also for screen readers and selections. */
export function text(node, value) {
  if (node.textContent !== value) node.textContent = value;
}

export function attribute(node, name, value) {
  if (node.getAttribute(name) !== String(value)) node.setAttribute(name, value);
}

export function className(node, value) {
  if (node.className !== value) node.className = value;
}

/** Texts as the items of a list, which is hidden when there are none. */
export function list(node, texts) {
  node.hidden = texts.length === 0;
  if ([...node.children].map((item) => item.textContent).join("\n") === texts.join("\n")) return;
  node.replaceChildren(...texts.map((item) => el("li", {}, item)));
}
