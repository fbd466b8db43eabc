// The server's description of itself (OpenAPI 3.1), as far as a form or a page of documentation needs it.

import { noServer, Refused } from "./api";
import { NO_SERVER } from "./strings";

export interface Schema {
  $ref?: string;
  type?: string | string[];
  description?: string;
  enum?: string[];
  examples?: string[];
  default?: unknown;
  minimum?: number;
  maximum?: number;
  required?: string[];
  properties?: Record<string, Schema>;
  items?: Schema;
  additionalProperties?: Schema | boolean;
  allOf?: Schema[];
  oneOf?: Schema[];
}

export interface Parameter {
  name: string;
  in: "path" | "query" | "header";
  description?: string;
  required?: boolean;
  schema: Schema;
}

export interface Operation {
  tags?: string[];
  summary?: string;
  description?: string;
  operationId?: string;
  parameters?: Parameter[];
  requestBody?: { content: Record<string, { schema?: Schema }>; required?: boolean };
  responses: Record<string, { description: string; content?: Record<string, { schema?: Schema }> }>;
}

export interface Description {
  info: { title: string; version: string; description?: string };
  paths: Record<string, Record<string, Operation>>;
  components: { schemas: Record<string, Schema> };
}

export async function describe(): Promise<Description> {
  const answer = await fetch(new URL("../openapi.json", location.href)).catch(() => null);
  if (answer?.ok && answer.headers.get("content-type")?.includes("json")) return (await answer.json()) as Description;
  throw new Refused(noServer(NO_SERVER.behindNone));
}

// What a reference leads to, and what there is where there may be nothing.
export function resolve(description: Description, schema: Schema): Schema {
  const present = schema.oneOf?.length === 2 && schema.oneOf.some((one) => one.type === "null") && schema.oneOf.find((one) => one.type !== "null");
  if (present) return resolve(description, present);
  if (!schema.$ref) return schema;
  const found = description.components.schemas[schema.$ref.split("/").pop() ?? ""] ?? {};
  return { ...found, description: schema.description ?? found.description ?? "" };
}

// All members of an object, those of the parts that it is made of too.
export function members(description: Description, schema: Schema): { properties: Record<string, Schema>; required: string[] } {
  const whole = resolve(description, schema);
  const parts = (whole.allOf ?? []).map((part) => members(description, part));
  return {
    properties: Object.assign({}, ...parts.map((part) => part.properties), whole.properties),
    required: [...parts.flatMap((part) => part.required), ...(whole.required ?? [])],
  };
}
