//! `ngf grasps`: search for grasps of one object.

use crate::object_selection::{ObjectOptions, SelectedObject};
use crate::progress_bar::Bar;
use crate::result_cache::ResultCache;
use anyhow::{Context, Result, bail};
use files::atomic_file;
use grasps::plan::object_poses::{NUM_COVERAGE_POSES, coverage};
use grasps::search::robustness;
use grasps::search::robustness::SimilarObject;
use grasps::search::{STAGE, SearchConfig, SearchCounts, refine_around, search, try_imported};
use grasps::set::clusters::ScoredGrasp;
use grasps::set::import::GraspFile;
use grasps::set::selection;
use grasps::{GraspSet, RobotContext};
use objects::object::Object;
use rayon::prelude::*;
use robot::Isometry;
use scene::SceneError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::cell::Cell;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Object, search effort and files of a grasp search.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    object: ObjectOptions,
    /// File of external grasps, which are closed and tested instead of a search
    #[arg(long, value_name = "FILE")]
    import: Option<PathBuf>,
    /// Number of grasps to search for
    #[arg(long, value_enum, default_value_t = Effort::Standard)]
    effort: Effort,
    /// Candidate or grasp files of earlier searches. Skips the search: perturbs the best candidates and
    /// selects by success rate under up to 15 mm and 6 degrees hand error (30 mm vertically)
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["import", "save_candidates"])]
    refine_from: Vec<PathBuf>,
    /// Seed of the search
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Output file of the selected grasps
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Write all robust grasps with their number of successful repeats to this file
    #[arg(long, value_name = "FILE")]
    save_candidates: Option<PathBuf>,
}

/// Effort of the search.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Effort {
    /// A few grasps within seconds, as on the page
    Quick,
    /// Grasps that cover the workspace
    Standard,
    /// Many robust grasps, without regard to coverage, as a start for --refine-from
    Thorough,
}

/// Searches for grasps and writes them.
pub(crate) fn run(options: &Options) -> Result<()> {
    let robot = RobotContext::standard()?;
    let SelectedObject { name, object, .. } = options.object.load()?;
    let config = match options.effort {
        Effort::Quick => SearchConfig::quick(&robot),
        Effort::Standard => SearchConfig::paper(&robot),
        Effort::Thorough => SearchConfig::thorough(&robot),
    };
    if !options.refine_from.is_empty() {
        if options.effort == Effort::Thorough {
            bail!("--refine-from cannot be used with --effort thorough");
        }
        let found = read_candidates(&options.refine_from)?;
        // Trials of another program version or object are invalid.
        let program = std::env::current_exe()
            .and_then(std::fs::read)
            .context("cannot read this executable")?;
        let fingerprint = [&blake3::hash(&program).to_hex(), object.hash().as_str()].join(" ");
        let journal = ResultCache::open(options.out.with_extension("cache"), &fingerprint)?;
        let (robot, name, object, seed) = (&robot, &name, &object, options.seed);
        let chooser = GraspSelector { robot, name, object, seed, cache: journal };
        let set = chooser.select(found, config.num_clusters)?;
        chooser.cache.delete()?;
        return write_set(options, robot, (name, object), &set);
    }
    let bar = Bar::new(STAGE, 100);
    let start = Instant::now();
    let first_robust = Cell::new(None);
    let last_counts = Cell::new(SearchCounts::default());
    let show = |counts: &SearchCounts| {
        bar.set((100.0 * counts.fraction) as usize);
        last_counts.set(*counts);
        if counts.robust > 0 && first_robust.get().is_none() {
            first_robust.set(Some(start.elapsed().as_secs_f64()));
        }
    };
    let (set, reliable) = match &options.import {
        None => search(&robot, &object, &config, options.seed, &show)?,
        Some(path) => {
            let bytes =
                std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            let file = GraspFile::parse(&bytes)?;
            let imported = file.convert(&robot.tree, &object)?;
            let progress = |_: &str, done: usize, total: usize| bar.update(done, total);
            try_imported(&robot, &object, &config, &imported, options.seed, &progress)?
        }
    };
    let seconds = start.elapsed().as_secs_f64();
    bar.clear();
    println!(
        "{name}: {} candidates, {} closed, {} tested, {} lifted",
        set.num_candidates, set.num_closed, set.num_tried, set.num_lifted
    );
    if options.import.is_none() {
        let SearchCounts { rejections, unapproachable, .. } = last_counts.get();
        println!(
            "{name}: rejected: {} collide, {} do not touch with thumb and finger, {} unbalanced, {} too heavy; \
             {unapproachable} without a motion into the grasp",
            rejections.collision,
            rejections.too_few_contacts,
            rejections.unbalanced,
            rejections.too_heavy,
        );
    }
    match first_robust.get() {
        Some(first) => {
            println!("{name}: first robust grasp after {first:.1} s, all after {seconds:.1} s");
        }
        None => println!("{name}: {seconds:.1} s"),
    }
    if let Some(path) = &options.save_candidates {
        atomic_file::write(path, &serde_json::to_vec_pretty(&reliable)?)?;
    }
    write_set(options, &robot, (&name, &object), &set)
}

/// Prints a summary of a grasp set and writes it.
fn write_set(
    options: &Options,
    robot: &RobotContext,
    (name, object): (&str, &Object),
    set: &GraspSet,
) -> Result<()> {
    println!(
        "{name}: {} robust; kept {} grasps in {} clusters",
        set.num_robust,
        set.grasps.len(),
        set.grasps.last().map_or(0, |last| last.cluster + 1),
    );
    for (kind, poses) in coverage(robot, object, &set.grasps).iter().enumerate() {
        println!("  cluster {kind}: preferred at {poses} of {NUM_COVERAGE_POSES} poses");
    }
    atomic_file::write(&options.out, &serde_json::to_vec_pretty(set)?)
}

/// Input of `--refine-from`: all robust grasps of a search, or a selected grasp set.
#[derive(serde::Deserialize)]
#[serde(untagged)]
enum Candidates {
    Robust(Vec<ScoredGrasp>),
    Selected(GraspSet),
}

/// Reads the candidates of earlier searches.
fn read_candidates(paths: &[PathBuf]) -> Result<Vec<ScoredGrasp>> {
    let read = |path: &PathBuf| -> Result<Vec<ScoredGrasp>> {
        let bytes =
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let found = serde_json::from_slice(&bytes).with_context(|| {
            format!("{} contains no grasps written by --save-candidates or --out", path.display())
        })?;
        Ok(match found {
            Candidates::Robust(found) => found,
            Candidates::Selected(set) => {
                let unscored = |grasp| ScoredGrasp { grasp, repeat_successes: 0, shake_slip: None };
                set.grasps.into_iter().map(unscored).collect()
            }
        })
    };
    Ok(paths.iter().map(read).collect::<Result<Vec<_>>>()?.concat())
}

/// Selects grasps by their robustness to hand pose error.
struct GraspSelector<'a> {
    robot: &'a RobotContext,
    name: &'a str,
    object: &'a Object,
    seed: u64,
    /// Cache of finished trials; a full run takes an hour.
    cache: ResultCache,
}

/// Seed offset of each round of searches around the most robust grasps.
const REFINE_SEEDS: [u64; 2] = [100, 200];

impl GraspSelector<'_> {
    /// Tests each grasp under hand pose error, searches around the best ones, and selects the clusters with
    /// the highest success rate.
    fn select(&self, mut found: Vec<ScoredGrasp>, kinds: usize) -> Result<GraspSet> {
        let (robot, object) = (self.robot, self.object);
        let similar = SimilarObject::variants_of(object)?;
        let mut rates = self.success_rates(&found, &similar)?;
        let centers = robustness::refine_seeds(robot, object, &found, &rates);
        let around = self.refine(&centers)?;
        rates.extend(self.success_rates(&around, &similar)?);
        found.extend(around);

        let covered = |(found, rate): (&ScoredGrasp, &f64)| match *rate == 0.0 {
            true => Ok(vec![false; NUM_COVERAGE_POSES]),
            false => robustness::covered_poses(robot, object, &found.grasp),
        };
        let covered: Vec<Vec<bool>> =
            self.map_cached("coverage", found.par_iter().zip(&rates), covered)?;
        let lifting = rates.iter().filter(|rate| **rate > 0.0).count();
        let hand = &robot.tree.hand;
        Ok(GraspSet {
            grasps: selection::select_grasps(hand, object, &found, &rates, &covered, kinds),
            num_candidates: 0,
            num_closed: 0,
            num_tried: found.len(),
            num_lifted: lifting,
            num_robust: found.len(),
        })
    }

    fn success_rates(&self, found: &[ScoredGrasp], similar: &[SimilarObject]) -> Result<Vec<f64>> {
        let (robot, object) = (self.robot, self.object);
        let rate = |found: &ScoredGrasp| {
            robustness::mean_success_rate(robot, object, similar, &found.grasp)
        };
        self.map_cached("robustness", found.par_iter(), rate)
    }

    /// Searches for robust grasps around each of these palm poses.
    fn refine(&self, centers: &[Isometry]) -> Result<Vec<ScoredGrasp>> {
        let config = SearchConfig::refinement(self.robot);
        let of = |round: u64| centers.iter().enumerate().map(move |(k, at)| (round + k as u64, at));
        let searches: Vec<_> = REFINE_SEEDS.into_iter().flat_map(of).collect();
        let search = |(seed, center): &(u64, &Isometry)| {
            refine_around(self.robot, self.object, &config, **center, self.seed + seed)
        };
        Ok(self.map_cached("refinement", searches.par_iter(), search)?.concat())
    }

    /// Applies `f` to each item on all threads, except for cached results, with a progress bar.
    fn map_cached<T: Send + Serialize, R: Send + Serialize + DeserializeOwned>(
        &self,
        stage: &str,
        items: impl IndexedParallelIterator<Item = T>,
        f: impl Fn(T) -> Result<R, SceneError> + Sync,
    ) -> Result<Vec<R>> {
        let bar = Bar::new(&format!("{}: {stage}", self.name), items.len());
        let done = AtomicUsize::new(0);
        let one = |item: T| {
            let key = format!("{stage} {}", serde_json::to_string(&item)?);
            let result = self.cache.get_or_compute(&key, || Ok(f(item)?));
            bar.set(1 + done.fetch_add(1, Ordering::Relaxed));
            result
        };
        let results = items.map(one).collect::<Result<_, _>>()?;
        bar.clear();
        Ok(results)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use grasps::set::catalog::catalog_grasps;

    #[test]
    fn candidates_and_grasp_sets_are_read_and_other_files_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: String| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let set = catalog_grasps("bleach").unwrap();
        let unscored = |grasp| ScoredGrasp { grasp, repeat_successes: 0, shake_slip: None };
        let candidates: Vec<ScoredGrasp> = set.grasps.iter().cloned().map(unscored).collect();
        let selected = file("selected.json", serde_json::to_string(&set).unwrap());
        let found = file("candidates.json", serde_json::to_string(&candidates).unwrap());
        let read = read_candidates(&[selected, found]).unwrap();
        let palms = |found: &[ScoredGrasp]| -> Vec<Isometry> {
            found.iter().map(|found| found.grasp.object_from_palm).collect()
        };
        assert_eq!(palms(&read), palms(&[candidates.clone(), candidates].concat()));
        let other = file("scene.json", "{\"scene\": 1}".to_owned());
        let error = read_candidates(&[other]).unwrap_err().to_string();
        assert!(
            error.contains("scene.json contains no grasps written by --save-candidates or --out"),
            "{error}"
        );
    }
}
