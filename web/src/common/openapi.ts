// Subset of OpenAPI 3.1 that the job form and the API page use.

import { ApiError, noServer } from "./api";
import type { components } from "./api_types";
import { NO_SERVER } from "./strings";

// Types of requests and responses, by the name of their schema.
export type Schemas = components["schemas"];

export interface Schema {
  $ref?: string;
  type?: string | string[];
  description?: string;
  enum?: string[];
  const?: unknown;
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

export interface OpenApi {
  info: { title: string; version: string; description?: string };
  paths: Record<string, Record<string, Operation>>;
  components: { schemas: Record<string, Schema> };
}

export async function fetchOpenApi(): Promise<OpenApi> {
  const response = await fetch(new URL("../openapi.json", location.href)).catch((error: unknown) => {
    throw new ApiError(noServer(String(error)));
  });
  if (response.ok && response.headers.get("content-type")?.includes("json")) return (await response.json()) as OpenApi;
  throw new ApiError(noServer(NO_SERVER.staticHost));
}

// Follows `$ref`, and unwraps a nullable `oneOf`.
export function resolve(api: OpenApi, schema: Schema): Schema {
  const isNullable = schema.oneOf?.length === 2 && schema.oneOf.some(({ type }) => type === "null");
  const variant = isNullable && schema.oneOf?.find(({ type }) => type !== "null");
  if (variant) return resolve(api, variant);
  if (!schema.$ref) return schema;
  const target = api.components.schemas[schema.$ref.split("/").pop() ?? ""] ?? {};
  return { ...target, description: schema.description ?? target.description ?? "" };
}

// Properties of an object schema, including those of its `allOf` parts.
export function objectProperties(api: OpenApi, schema: Schema): { properties: Record<string, Schema>; required: string[] } {
  const resolved = resolve(api, schema);
  const parts = (resolved.allOf ?? []).map((part) => objectProperties(api, part));
  return {
    properties: Object.assign({}, ...parts.map((part) => part.properties), resolved.properties),
    required: [...parts.flatMap((part) => part.required), ...(resolved.required ?? [])],
  };
}
