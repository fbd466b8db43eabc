// What tests ask of a server that does jobs, and of its page.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { blank, open, PATIENCE } from "./chromium.js";
import { BOX } from "./meshes.js";

export const stands = (page, status) => page.waitForSelector(`.detail-job .chip.is-${status}`);

export async function until(holds) {
  for (const end = Date.now() + PATIENCE; !holds(); ) {
    assert.ok(Date.now() < end, `it never holds: ${holds}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

// A browser, and a server with a folder of its own.
export async function openJobs() {
  const folder = mkdtempSync(join(tmpdir(), "ngf-"));
  const served = await open({ data: join(folder, "data") });

  const api = async (path, body) => {
    const answer = await fetch(`${served.address}/api/v1/${path}`, body && { method: "POST", body: JSON.stringify(body) });
    assert.ok(answer.ok, `${path}: ${answer.status}`);
    return answer.json();
  };

  // A job once it is over.
  const over = async (id) => {
    for (;;) {
      const job = await api(`jobs/${id}?wait=30s`);
      if (["succeeded", "failed", "cancelled"].includes(job.status)) return job;
    }
  };

  return {
    folder,
    served,
    api,
    over,
    async visit(route = "", options = {}) {
      const { page, complaints } = await blank(served, options);
      await page.goto(`${served.address}/jobs/${route}`);
      return { page, complaints };
    },
    // A job that is done.
    async made(kind, params, name) {
      const { id } = await api("jobs", { kind, params, name });
      const job = await over(id);
      assert.equal(job.status, "succeeded", JSON.stringify(job.error));
      return job;
    },
    // A job that takes long and needs nothing.
    long: (params = {}, name = null) =>
      api("jobs", { kind: "policy.evaluate", params: { model_id: "planner", object: "sugar_box", attempts: 10_000, ...params }, name }),
    async stop(id) {
      await api(`jobs/${id}/cancel`, {});
      return over(id);
    },
    async uploaded(name = "box.obj", body = BOX) {
      const answer = await fetch(`${served.address}/api/v1/meshes?name=${name}`, { method: "POST", body });
      assert.ok(answer.ok, `${answer.status}`);
      return answer.json();
    },
    async close() {
      await served.close();
      rmSync(folder, { recursive: true, force: true });
    },
  };
}
