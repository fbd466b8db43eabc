//! Grasp search of the page: one worker decides, and several workers execute its tasks.

use super::{Session, worker_failed};
use crate::protocol::{Event, Failure, GraspsFound, SearchBatch};
use grasps::search::{GraspSearch, GraspTester, SearchConfig, Task, TaskResult};
use objects::Object;
use serde_bytes::ByteBuf;

impl Session {
    fn search_config(&self, is_long: bool) -> SearchConfig {
        let robot = &self.context.robot;
        if is_long { SearchConfig::paper(robot) } else { SearchConfig::quick(robot) }
    }

    /// Starts a search for grasps of the current object. Returns its first tasks.
    pub(crate) fn start_search(&mut self, is_long: bool) -> Event {
        let mut event = self.next_search_event(GraspSearch::new(self.search_config(is_long)));
        if let Event::SearchBatch(batch) = &mut event {
            batch.object = Some(self.object_bytes());
        }
        event
    }

    /// Discards the search.
    pub(crate) fn cancel_search(&mut self) {
        self.search = None;
    }

    /// Replaces the object by that of another worker.
    pub(crate) fn load_object_bytes(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.loaded.object = Object::from_bytes(bytes).map_err(|error| worker_failed(&error))?;
        Ok(())
    }

    /// Executes a task of a search that another worker decides. The search has this seed and length.
    pub(crate) fn run_search_task(
        &self,
        seed: u32,
        is_long: bool,
        task: &[u8],
    ) -> Result<ByteBuf, Failure> {
        let config = self.search_config(is_long);
        let robot = &self.context.robot;
        let tester = GraspTester::new(robot, &self.loaded.object, &config, u64::from(seed));
        let task = Task::from_bytes(task).map_err(|error| worker_failed(&error))?;
        let result = tester.execute(&task).map_err(|error| worker_failed(&error))?;
        Ok(ByteBuf::from(result.to_bytes()))
    }

    /// Takes the results of the current tasks, in their order. Returns the next tasks or the grasps found; `None`
    /// if the search was discarded meanwhile, for example with its object.
    pub(crate) fn complete_search_batch(
        &mut self,
        results: &[ByteBuf],
    ) -> Result<Option<Event>, Failure> {
        let Some(mut search) = self.search.take() else { return Ok(None) };
        let results: Result<Vec<_>, _> =
            results.iter().map(|result| TaskResult::from_bytes(result)).collect();
        search.complete(results.map_err(|error| worker_failed(&error))?);
        Ok(Some(self.next_search_event(search)))
    }

    fn next_search_event(&mut self, mut search: GraspSearch) -> Event {
        let tasks = search.next_batch(&self.context.robot, &self.loaded.object);
        let counts = search.counts();
        if tasks.is_empty() {
            let (set, _) = search.finish();
            return Event::GraspsFound(self.grasps_found(&set.grasps, counts.tried));
        }
        let robust: Vec<_> = search.robust_grasps().cloned().collect();
        let found = self.grasps_found(&robust, counts.tried);
        self.search = Some(search);
        let tasks = tasks.iter().map(|task| ByteBuf::from(task.to_bytes())).collect();
        Event::SearchBatch(SearchBatch { object: None, tasks, fraction: counts.fraction, found })
    }

    fn grasps_found(&self, grasps: &[grasps::Grasp], num_tried: usize) -> GraspsFound {
        GraspsFound {
            grasps: grasps.iter().map(|grasp| ByteBuf::from(grasp.to_bytes())).collect(),
            tried: num_tried,
            object_hash: self.object_hash.clone(),
        }
    }
}

#[cfg(all(test, target_arch = "wasm32"))]
mod tests {
    use super::*;
    use wasm_bindgen_test::wasm_bindgen_test;

    #[wasm_bindgen_test]
    fn worker_executes_the_tasks_of_another_one() {
        let (Ok(mut page), Ok(mut helper)) = (Session::new(), Session::new()) else {
            panic!("no session");
        };
        let Event::SearchBatch(first) = page.start_search(false) else { panic!("no tasks") };
        // The helper has another object until it receives that of the search.
        helper.load(crate::object_import::load_built_in("bleach").ok().unwrap());
        let object = first.object.expect("the object of the search");
        assert!(helper.load_object_bytes(&object).is_ok());
        assert_eq!(helper.loaded.object.hash(), page.loaded.object.hash());
        let run = |task: &ByteBuf| helper.run_search_task(0, false, task).ok().unwrap();
        let results: Vec<ByteBuf> = first.tasks.iter().map(run).collect();
        let next = page.complete_search_batch(&results).ok().unwrap();
        let Some(Event::SearchBatch(next)) = next else { panic!("the search ended") };
        assert!(next.object.is_none() && !next.tasks.is_empty());
        assert!(next.fraction > 0.0 && next.fraction < 1.0, "{}", next.fraction);
        // Results of a discarded search are ignored.
        page.cancel_search();
        assert!(matches!(page.complete_search_batch(&results), Ok(None)));
        assert!(helper.run_search_task(0, false, b"no task").is_err());
    }
}
