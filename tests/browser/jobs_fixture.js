// Test fixture: a server with jobs, and requests to its API.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { newPage, open, TIMEOUT_MS } from "./chromium.js";
import { BOX } from "./meshes.js";

export const untilStatus = (page, status) => page.waitForSelector(`.job-detail .chip.is-${status}`);

export async function until(condition) {
  for (const end = Date.now() + TIMEOUT_MS; !condition(); ) {
    assert.ok(Date.now() < end, `timeout: ${condition}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

// Starts a browser and a server with a temporary data directory.
export async function openJobs() {
  const folder = mkdtempSync(join(tmpdir(), "ngf-"));
  const served = await open({ data: join(folder, "data") });

  const api = async (path, body) => {
    const response = await fetch(`${served.address}/api/v1/${path}`, body && { method: "POST", body: JSON.stringify(body) });
    assert.ok(response.ok, `${path}: ${response.status}`);
    return response.json();
  };

  const hasEnded = ({ status }) => ["succeeded", "failed", "cancelled"].includes(status);

  // Waits for the end of a job.
  const untilEnded = async (id) => {
    for (const end = Date.now() + TIMEOUT_MS; ; ) {
      const job = await api(`jobs/${id}?wait=30s`);
      if (hasEnded(job)) return job;
      assert.ok(Date.now() < end, `timeout: job ${id} is ${job.status}`);
    }
  };

  return {
    folder,
    served,
    api,
    untilEnded,
    async visit(route = "", options = {}) {
      const { page, errors } = await newPage(served, options);
      await page.goto(`${served.address}/jobs/${route}`);
      return { page, errors };
    },
    // Runs a job, which must succeed.
    async runJob(kind, params, name) {
      const { id } = await api("jobs", { kind, params, name });
      const job = await untilEnded(id);
      assert.equal(job.status, "succeeded", JSON.stringify(job.error));
      return job;
    },
    // Starts a long job without inputs.
    startLongJob: (params = {}, name = null) =>
      api("jobs", { kind: "policy.evaluate", params: { model_id: "planner", object: "sugar_box", attempts: 10_000, ...params }, name }),
    async cancel(id) {
      await api(`jobs/${id}/cancel`, {});
      return untilEnded(id);
    },
    // A job that a failed test leaves running would delay the jobs of the next tests.
    async cancelAll() {
      const { data } = await api("jobs?limit=100");
      for (const { id } of data.filter((job) => !hasEnded(job))) await this.cancel(id);
    },
    // Waits until a training job has written `count` checkpoints.
    async untilNumCheckpoints(id, count) {
      for (const end = Date.now() + TIMEOUT_MS; (await api(`jobs/${id}/checkpoints`)).data.length < count; ) {
        assert.ok(Date.now() < end, `timeout: job ${id} has fewer than ${count} checkpoints`);
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
    },
    async uploadMesh(name = "box.obj", body = BOX) {
      const response = await fetch(`${served.address}/api/v1/meshes?name=${name}`, { method: "POST", body });
      assert.ok(response.ok, `${response.status}`);
      return response.json();
    },
    async close() {
      await served.close();
      rmSync(folder, { recursive: true, force: true });
    },
  };
}
