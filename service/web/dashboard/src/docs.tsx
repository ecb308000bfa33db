// Renders openapi.json: operations with their parameters and the fields of their answers.
import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import { ask, TokenNeeded } from "./ask";
import { failure } from "./sentences";
import { SignIn } from "./sign_in";
import { t } from "./texts";

const PATIENCE_MS = 30_000; // at the first time the daemon makes it, which takes seconds on a small machine

interface Schema {
  $ref?: string;
  anyOf?: Schema[];
  enum?: unknown[];
  type?: string;
  format?: string;
  items?: Schema;
  additionalProperties?: Schema;
  properties?: Record<string, Schema>;
  description?: string;
  default?: unknown;
}

type Content = Record<string, { schema?: Schema }>;

interface Operation {
  summary?: string;
  description?: string;
  tags?: string[];
  parameters?: { name: string; in: string; required?: boolean; description?: string; schema?: Schema }[];
  requestBody?: { content: Content };
  responses: Record<string, { description: string; content?: Content }>;
}

interface OpenApi {
  info: { title: string; version: string; description: string };
  paths: Record<string, Record<string, Operation>>;
  components?: { schemas?: Record<string, Schema> };
}

const nameOf = (ref: string): string => ref.split("/").at(-1) ?? "";

/** A schema in a few words: "number or null", "list of Axis". */
function kind(schema: Schema = {}): string {
  if (schema.$ref) return nameOf(schema.$ref);
  if (schema.anyOf) return schema.anyOf.map(kind).join(" or ");
  if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(" or ");
  if (schema.type === "array") return `list of ${kind(schema.items)}`;
  if (schema.type === "object" && schema.additionalProperties) return `${kind(schema.additionalProperties)} by name`;
  return schema.format ?? schema.type ?? "anything";
}

function Table({ columns, rows }: { columns: string[]; rows: ComponentChildren[][] }) {
  return (
    <table>
      <thead><tr>{columns.map((name) => <th key={name} scope="col">{name}</th>)}</tr></thead>
      <tbody>{rows.map((row, i) => <tr key={i}>{row.map((cell, k) => <td key={k}>{cell}</td>)}</tr>)}</tbody>
    </table>
  );
}

const fallback = ({ default: given }: Schema = {}): string => (given === undefined || given === null ? "" : `default ${String(given)}`);

function OperationPart({ method, path, op }: { method: string; path: string; op: Operation }) {
  const answers = Object.entries(op.responses).map(([status, answer]) => {
    const [media, content] = Object.entries(answer.content ?? {})[0] ?? ["", {}];
    return [<code>{status}</code>, content.schema ? kind(content.schema) : media, answer.description];
  });
  return (
    <details>
      <summary><code>{`${method.toUpperCase()} ${path}`}</code> {op.summary}</summary>
      <div>
        <p>{op.description}</p>
        {op.parameters && (
          <>
            <h3>Parameters</h3>
            <Table columns={["Name", "In", "Type", "Meaning"]} rows={op.parameters.map((p) => [
              <code>{p.name}</code>, `${p.in}${p.required ? ", required" : ""}`, kind(p.schema),
              [p.description ?? p.schema?.description, fallback(p.schema)].filter(Boolean).join("; "),
            ])} />
          </>
        )}
        {Object.entries(op.requestBody?.content ?? {}).map(([media, content]) => (
          <>
            <h3>Request</h3>
            <Table columns={["Media type", "Body"]} rows={[[<code>{media}</code>, kind(content.schema)]]} />
          </>
        ))}
        <h3>Answers</h3>
        <Table columns={["Status", "Body", "Meaning"]} rows={answers} />
      </div>
    </details>
  );
}

function BodyPart({ name, schema }: { name: string; schema: Schema }) {
  const fields = Object.entries(schema.properties ?? {});
  return (
    <details id={`body-${name}`}>
      <summary><code>{name}</code></summary>
      <div>
        <p>{schema.description}</p>
        {fields.length > 0 && (
          <Table columns={["Field", "Type", "Meaning"]} rows={fields.map(([field, s]) => [<code>{field}</code>, kind(s), s.description])} />
        )}
        {schema.enum && <p>{kind(schema)}</p>}
      </div>
    </details>
  );
}

export function Docs() {
  const [api, set] = useState<OpenApi | null>(null);
  const [problem, setProblem] = useState<unknown>(null);
  useEffect(() => {
    document.title = "axiswatch API";
    void ask<OpenApi>("/openapi.json", null, PATIENCE_MS).then(set, setProblem);
  }, []);
  return (
    <div class="docs">
      <header>
        <div class="bar-top">
          <a class="brand" href="/"><img src="/static/icon.svg" alt="" width="24" height="24" /> axiswatch</a>
          <nav aria-label={t.pages.overview}><a href="/">{t.pages.overview}</a> <a href="/openapi.json">OpenAPI</a></nav>
        </div>
        {problem instanceof TokenNeeded && <SignIn why={failure(problem)} />}
      </header>
      <main>
        <h1>{api ? `${api.info.title} API ${api.info.version}` : "axiswatch API"}</h1>
        {api ? <Everything api={api} /> : <p class="quiet">{problem ? failure(problem) : t.schemaLoading}</p>}
      </main>
    </div>
  );
}

function Everything({ api }: { api: OpenApi }) {
  const groups = new Map<string, ComponentChildren[]>();
  for (const [path, methods] of Object.entries(api.paths)) {
    for (const [method, op] of Object.entries(methods)) {
      const tag = op.tags?.[0] ?? "other";
      groups.set(tag, [...(groups.get(tag) ?? []), <OperationPart key={method + path} {...{ method, path, op }} />]);
    }
  }
  return (
    <>
      <p class="lead">{api.info.description}</p>
      {[...groups].map(([tag, operations]) => <section key={tag}><h2>{tag}</h2>{operations}</section>)}
      <h2>bodies</h2>
      {Object.entries(api.components?.schemas ?? {}).map(([name, schema]) => <BodyPart key={name} {...{ name, schema }} />)}
    </>
  );
}
