// Renders openapi.json: operations with their parameters and the fields of their answers.

import { el } from "./dom.js";
import { ask } from "./token.js";

const nameOf = (ref) => ref.split("/").pop();

/** A schema in a few words: "number or null", "list of Axis". */
function kind(schema = {}) {
  if (schema.$ref) return nameOf(schema.$ref);
  if (schema.anyOf) return schema.anyOf.map(kind).join(" or ");
  if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(" or ");
  if (schema.type === "array") return `list of ${kind(schema.items)}`;
  if (schema.type === "object" && schema.additionalProperties) return `${kind(schema.additionalProperties)} by name`;
  return schema.format ?? schema.type ?? "anything";
}

function table(columns, rows) {
  const head = el("tr", {}, ...columns.map((name) => el("th", { scope: "col" }, name)));
  const body = rows.map((row) => el("tr", {}, ...row.map((cell) => el("td", {}, cell))));
  return el("table", {}, el("thead", {}, head), el("tbody", {}, ...body));
}

const code = (value) => el("code", {}, value);
const fallback = (schema = {}) => (schema.default === undefined || schema.default === null ? "" : `default ${schema.default}`);

function operation(path, method, op) {
  const inside = el("div", {}, el("p", {}, op.description));
  if (op.parameters) {
    const rows = op.parameters.map((p) => [
      code(p.name),
      `${p.in}${p.required ? ", required" : ""}`,
      kind(p.schema),
      [p.description ?? p.schema?.description, fallback(p.schema)].filter(Boolean).join("; "),
    ]);
    inside.append(el("h4", {}, "Parameters"), table(["Name", "In", "Type", "Meaning"], rows));
  }
  for (const [media, content] of Object.entries(op.requestBody?.content ?? {})) {
    inside.append(el("h4", {}, "Request"), table(["Media type", "Body"], [[code(media), kind(content.schema)]]));
  }
  const rows = Object.entries(op.responses).map(([status, answer]) => {
    const [media, content] = Object.entries(answer.content ?? {})[0] ?? ["", {}];
    return [code(status), content.schema ? kind(content.schema) : media, answer.description];
  });
  inside.append(el("h4", {}, "Answers"), table(["Status", "Body", "Meaning"], rows));
  const summary = el("summary", {}, code(`${method.toUpperCase()} ${path}`), ` ${op.summary ?? ""}`);
  return el("details", {}, summary, inside);
}

function body(name, schema) {
  const fields = Object.entries(schema.properties ?? {});
  const rows = fields.map(([field, s]) => [code(field), kind(s), s.description ?? ""]);
  const inside = el("div", {}, el("p", {}, schema.description ?? ""));
  if (rows.length) inside.append(table(["Field", "Type", "Meaning"], rows));
  if (schema.enum) inside.append(el("p", {}, kind(schema)));
  return el("details", { id: `body-${name}` }, el("summary", {}, code(name)), inside);
}

async function show() {
  const main = document.getElementById("main");
  const api = await ask("/openapi.json");
  document.getElementById("title").textContent = `${api.info.title} API ${api.info.version}`;
  const groups = new Map();
  for (const [path, methods] of Object.entries(api.paths)) {
    for (const [method, op] of Object.entries(methods)) {
      const tag = op.tags?.[0] ?? "other";
      groups.set(tag, [...(groups.get(tag) ?? []), operation(path, method, op)]);
    }
  }
  const bodies = Object.entries(api.components?.schemas ?? {}).map(([name, schema]) => body(name, schema));
  main.replaceChildren(
    el("p", { className: "lead" }, api.info.description),
    ...[...groups].flatMap(([tag, operations]) => [el("h2", {}, tag), ...operations]),
    el("h2", {}, "bodies"),
    ...bodies,
  );
}

show().catch((error) => {
  document.getElementById("main").replaceChildren(el("p", { className: "banner bad" }, `No answer: ${error.message}`));
});
