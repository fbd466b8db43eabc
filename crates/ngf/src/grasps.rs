//! `ngf grasps`: searches grasps of one object.

use crate::bar::Bar;
use crate::journal::Journal;
use crate::objects::{ObjectOptions, Subject};
use anyhow::{Context, Result};
use dataset::store;
use geometry::object::Object;
use grasps::import::GraspFile;
use grasps::kind::Scored;
use grasps::place::{REACH_POSES, poses_served};
use grasps::search::{SearchConfig, search, search_around, try_imported};
use grasps::tolerance::Like;
use grasps::{GraspSet, Robot, choice, tolerance};
use rayon::prelude::*;
use robot::Isometry;
use scene::SceneError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What to search for.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    object: ObjectOptions,
    /// File of grasps from elsewhere, which are closed and tried instead of a search.
    #[arg(long, value_name = "FILE")]
    import: Option<PathBuf>,
    /// Look for three times as many reliable grasps.
    #[arg(long)]
    thorough: bool,
    /// Look for a few, soon, as the page does.
    #[arg(long, conflicts_with = "thorough")]
    quick: bool,
    /// Files of reliable or of chosen grasps of earlier searches, among which, and among more around the best of them, to
    /// choose instead of a search from the beginning: by how often each lifts when the hand comes up to 15 mm and 6 degrees
    /// beside its place, and in height up to 30 mm.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["import", "thorough", "reliable"])]
    among: Vec<PathBuf>,
    /// Seed of the search.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Where to write the grasps.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Where to write all reliable grasps with their repeats that lifted.
    #[arg(long, value_name = "FILE")]
    reliable: Option<PathBuf>,
}

/// Searches grasps and writes them.
pub(crate) fn run(options: &Options) -> Result<()> {
    let robot = Robot::standard()?;
    let Subject { name, object, .. } = options.object.load()?;
    let config = match (options.thorough, options.quick) {
        (true, _) => SearchConfig::thorough(&robot),
        (_, true) => SearchConfig::quick(&robot),
        _ => SearchConfig::paper(&robot),
    };
    if !options.among.is_empty() {
        let found = read_found(&options.among)?;
        // What was tried by another program, or with another object, does not count.
        let program = std::env::current_exe().and_then(std::fs::read).context("no program")?;
        let owner = [&blake3::hash(&program).to_hex(), object.hash().as_str()].join(" ");
        let journal = Journal::open(options.out.with_extension("tried"), &owner)?;
        let (robot, name, object, seed) = (&robot, &name, &object, options.seed);
        let chooser = Chooser { robot, name, object, seed, journal };
        let set = chooser.choose(found, config.kinds)?;
        chooser.journal.remove()?;
        return write(options, robot, (name, object), &set);
    }
    let bar = Bar::new(&format!("{name}: grasps"), 100);
    let progress = |share| bar.set((share * 100.0) as usize);
    let (set, reliable) = match &options.import {
        None => search(&robot, &object, &config, options.seed, progress)?,
        Some(path) => {
            let bytes =
                std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            let file = GraspFile::parse(&bytes)?;
            let imported = file.read(&robot.tree, &object)?;
            try_imported(&robot, &object, &config, &imported, options.seed, progress)?
        }
    };
    bar.clear();
    println!(
        "{name}: {} proposals, {} closed, {} tried, {} lifted",
        set.proposed, set.closed, set.tried, set.lifted
    );
    if let Some(path) = &options.reliable {
        store::write(path, &serde_json::to_vec_pretty(&reliable)?)?;
    }
    write(options, &robot, (&name, &object), &set)
}

/// Says what a set holds, and writes it.
fn write(
    options: &Options,
    robot: &Robot,
    (name, object): (&str, &Object),
    set: &GraspSet,
) -> Result<()> {
    println!(
        "{name}: {} reliable; with arm and hand {} of {} lifted; {} grasps of {} kinds kept",
        set.reliable,
        set.confirmed[1],
        set.confirmed[0],
        set.grasps.len(),
        set.grasps.last().map_or(0, |last| last.kind + 1),
    );
    for (kind, poses) in poses_served(robot, object, &set.grasps).iter().enumerate() {
        println!("  kind {kind}: the first within reach at {poses} of {REACH_POSES} poses");
    }
    store::write(&options.out, &serde_json::to_vec_pretty(set)?)
}

/// What `--among` reads: every reliable grasp of a search, or the few that were chosen.
#[derive(serde::Deserialize)]
#[serde(untagged)]
enum Found {
    Reliable(Vec<Scored>),
    Chosen(GraspSet),
}

/// The reliable grasps that earlier searches wrote, and those that were chosen.
fn read_found(paths: &[PathBuf]) -> Result<Vec<Scored>> {
    let read = |path: &PathBuf| -> Result<Vec<Scored>> {
        let bytes =
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        let found = serde_json::from_slice(&bytes).with_context(|| {
            format!("{} holds no grasps as --reliable or --out writes them", path.display())
        })?;
        Ok(match found {
            Found::Reliable(found) => found,
            Found::Chosen(set) => {
                let unscored = |grasp| Scored { grasp, again: 0, shaken: None };
                set.grasps.into_iter().map(unscored).collect()
            }
        })
    };
    Ok(paths.iter().map(read).collect::<Result<Vec<_>>>()?.concat())
}

/// Chooses among grasps by how they bear a hand beside its place.
struct Chooser<'a> {
    robot: &'a Robot,
    name: &'a str,
    object: &'a Object,
    seed: u64,
    /// What was tried so far: it takes an hour.
    journal: Journal,
}

/// Searches around the most tolerant grasps, and the seed from which on each of them draws.
const ROUNDS: [u64; 2] = [100, 200];

impl Chooser<'_> {
    /// Tries each grasp beside its place, looks for more around the best, and chooses the kinds that lift the most.
    fn choose(&self, mut found: Vec<Scored>, kinds: usize) -> Result<GraspSet> {
        let (robot, object) = (self.robot, self.object);
        let like = Like::all(object)?;
        let mut shares = self.shares(&found, &like)?;
        let centers = tolerance::centers(robot, object, &found, &shares);
        let around = self.around(&centers)?;
        shares.extend(self.shares(&around, &like)?);
        found.extend(around);

        let served = |(found, share): (&Scored, &f64)| match *share == 0.0 {
            true => Ok(vec![false; REACH_POSES]),
            false => tolerance::served(robot, object, &found.grasp),
        };
        let served: Vec<Vec<bool>> = self.each("reach", found.par_iter().zip(&shares), served)?;
        let lifting = shares.iter().filter(|share| **share > 0.0).count();
        Ok(GraspSet {
            grasps: choice::choose(object, &found, &shares, &served, kinds),
            proposed: 0,
            closed: 0,
            tried: 0,
            lifted: 0,
            reliable: found.len(),
            confirmed: [found.len(), lifting],
        })
    }

    fn shares(&self, found: &[Scored], like: &[Like]) -> Result<Vec<f64>> {
        let (robot, object) = (self.robot, self.object);
        let share = |found: &Scored| tolerance::share_among(robot, object, like, &found.grasp);
        self.each("tolerance", found.par_iter(), share)
    }

    /// Reliable grasps around each of these.
    fn around(&self, centers: &[Isometry]) -> Result<Vec<Scored>> {
        let config = SearchConfig::around(self.robot);
        let of = |round: u64| centers.iter().enumerate().map(move |(k, at)| (round + k as u64, at));
        let searches: Vec<_> = ROUNDS.into_iter().flat_map(of).collect();
        let search = |(seed, center): &(u64, &Isometry)| {
            search_around(self.robot, self.object, &config, **center, self.seed + seed)
        };
        Ok(self.each("around", searches.par_iter(), search)?.concat())
    }

    /// Applies `f` to each on all threads, unless its result is known, and shows how far it is.
    fn each<T: Send + Serialize, R: Send + Serialize + DeserializeOwned>(
        &self,
        what: &str,
        items: impl IndexedParallelIterator<Item = T>,
        f: impl Fn(T) -> Result<R, SceneError> + Sync,
    ) -> Result<Vec<R>> {
        let bar = Bar::new(&format!("{}: {what}", self.name), items.len());
        let done = AtomicUsize::new(0);
        let one = |item: T| {
            let key = format!("{what} {}", serde_json::to_string(&item)?);
            let result = self.journal.result(&key, || Ok(f(item)?));
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
    use grasps::built_in::built_in;

    #[test]
    fn reliable_and_chosen_grasps_are_read_alike_and_other_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: String| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let set = built_in("bleach").unwrap();
        let unscored = |grasp| Scored { grasp, again: 0, shaken: None };
        let reliable: Vec<Scored> = set.grasps.iter().cloned().map(unscored).collect();
        let chosen = file("chosen.json", serde_json::to_string(&set).unwrap());
        let found = file("reliable.json", serde_json::to_string(&reliable).unwrap());
        let read = read_found(&[chosen, found]).unwrap();
        let palms = |found: &[Scored]| -> Vec<Isometry> {
            found.iter().map(|found| found.grasp.object_from_palm).collect()
        };
        assert_eq!(palms(&read), palms(&[reliable.clone(), reliable].concat()));
        let other = file("scene.json", "{\"scene\": 1}".to_owned());
        let error = read_found(&[other]).unwrap_err().to_string();
        assert!(error.contains("scene.json holds no grasps as --reliable or --out"), "{error}");
    }
}
