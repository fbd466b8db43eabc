//! `ngf dataset`: makes datasets, and says what is in them.

use crate::bar::Bar;
use crate::objects::{ObjectOptions, Subject};
use anyhow::{Context, Result, bail};
use dataset::config::{DatasetConfig, PRESETS};
use dataset::generate::built_in_objects;
use dataset::summary::Summary;
use dataset::{Dataset, Manifest, Objects, Observer};
use grasps::Robot;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Makes a dataset, or looks into one.
#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Options {
    #[command(subcommand)]
    look: Option<Look>,
    #[command(flatten)]
    make: Make,
}

/// What to do with a dataset that is there.
#[derive(clap::Subcommand)]
enum Look {
    /// Say what is in it.
    Info {
        /// Folder of the dataset.
        dir: PathBuf,
        /// The manifest and the counts as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Write a report with pictures: grasps, success over the table, trajectories, reasons of failure.
    Show {
        /// Folder of the dataset.
        dir: PathBuf,
        /// Where to write it; in the folder by default.
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
    /// Write one kept demonstration as a file that the page plays when it is dropped there.
    Episode {
        /// Folder of the dataset.
        dir: PathBuf,
        /// Index of the episode.
        index: usize,
        /// Where to write it.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Read every file again: hashes, and Eq. 6 and 7 in every row.
    Verify {
        /// Folder of the dataset.
        dir: PathBuf,
    },
}

/// What to make.
#[derive(clap::Args)]
struct Make {
    /// smoke, small, variants, paper or families.
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// Folder of the dataset.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of everything.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads; all by default. The bytes do not depend on it.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Go on with a folder that is half done.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    object: ObjectOptions,
}

/// Makes a dataset or looks into one.
pub(crate) fn run(options: &Options) -> Result<()> {
    match &options.look {
        None => make(&options.make),
        Some(Look::Info { dir, json }) => info(dir, *json),
        Some(Look::Show { dir, out }) => show(dir, out.as_deref()),
        Some(Look::Episode { dir, index, out }) => episode(dir, *index, out),
        Some(Look::Verify { dir }) => verify(dir),
    }
}

fn make(options: &Make) -> Result<()> {
    let (Some(name), Some(out)) = (&options.preset, &options.out) else {
        bail!("say what to make and where: --preset NAME --out DIR; presets:{}", presets());
    };
    let unknown = || format!("there is no preset {name}; there are:{}", presets());
    let preset = DatasetConfig::preset(name, options.seed).with_context(unknown)?;
    let (config, objects) = match options.object.load_any()? {
        Some(Subject { name, object, .. }) => {
            (preset.of_object(&name), Objects::from([(name, object)]))
        }
        None => {
            let objects = built_in_objects(preset.all_objects())?;
            (preset, objects)
        }
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(options.threads)
        .build_global()
        .context("cannot start the threads; try fewer with --threads")?;
    let dataset = Dataset::create(out, config, &objects, options.resume)?;
    let watch = Watch::new(out);
    let robot = Robot::standard()?;
    let manifest = dataset.generate(&robot, &objects, watch)?;
    watch.end();
    let summary = dataset.summary()?;
    print_counts(&summary);
    println!("{:.1} MB, hash {}", manifest.bytes() as f64 / 1e6, manifest.hash);
    for (name, _) in summary.iter().filter(|(_, counts)| counts.kept() == 0) {
        eprintln!(
            "warning: there is no demonstration of {name}: no grasp of it was found that lifts. Is it too heavy, too \
             wide for the hand, or too low? `ngf grasps` says how far its search comes"
        );
    }
    Ok(())
}

/// Names of the presets, each with what it is for.
fn presets() -> String {
    PRESETS.iter().map(|(name, about)| format!("\n  {name:9} {about}")).collect()
}

/// Shows how far the work is, writes down how long each stage took, and stops at Ctrl-C.
struct Watch {
    log: PathBuf,
    stage: Mutex<Option<Stage>>,
    is_stopped: AtomicBool,
}

struct Stage {
    name: String,
    bar: Bar,
    begin: Instant,
    /// Things that were there already.
    first: usize,
    done: usize,
}

impl Watch {
    /// Looks on until the process ends.
    fn new(dir: &Path) -> &'static Self {
        let (stage, is_stopped) = (Mutex::new(None), AtomicBool::new(false));
        let watch: &'static Self =
            Box::leak(Box::new(Self { log: dir.join("log.jsonl"), stage, is_stopped }));
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
            let interrupted = runtime.map(|runtime| runtime.block_on(tokio::signal::ctrl_c()));
            if matches!(interrupted, Ok(Ok(()))) {
                watch.is_stopped.store(true, Ordering::Relaxed);
            }
        });
        watch
    }

    /// Ends the last stage.
    fn end(&self) {
        if let Ok(mut stage) = self.stage.lock() {
            self.close(stage.take());
        }
    }

    fn close(&self, stage: Option<Stage>) {
        let Some(stage) = stage else { return };
        stage.bar.clear();
        let seconds = stage.begin.elapsed().as_secs_f64();
        let made = stage.done - stage.first;
        if made == 0 {
            return;
        }
        println!("{}: {made} in {seconds:.1} s, {:.1}/s", stage.name, made as f64 / seconds);
        let line = serde_json::json!({
            "stage": stage.name, "made": made, "seconds": seconds,
            "threads": rayon::current_num_threads(),
        });
        let log = std::fs::OpenOptions::new().create(true).append(true).open(&self.log);
        // The log is for people: a dataset is as good without it.
        log.and_then(|mut log| writeln!(log, "{line}")).ok();
    }
}

impl Observer for Watch {
    fn progress(&self, name: &str, done: usize, total: usize) {
        let Ok(mut stage) = self.stage.lock() else { return };
        if stage.as_ref().is_none_or(|stage| stage.name != name) {
            self.close(stage.take());
            let (bar, begin) = (Bar::begun(name, done, total), Instant::now());
            *stage = Some(Stage { name: name.to_owned(), bar, begin, first: done, done });
        }
        if let Some(stage) = stage.as_mut() {
            stage.done = stage.done.max(done);
            stage.bar.set(stage.done);
        }
    }

    fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }
}

fn info(dir: &Path, is_json: bool) -> Result<()> {
    let (dataset, manifest) = (Dataset::open(dir)?, Manifest::read(dir)?);
    let summary = dataset.summary()?;
    if is_json {
        let mut value = serde_json::to_value(&manifest)?;
        value["summary"] = serde_json::to_value(&summary)?;
        println!("{}", serde_json::to_string_pretty(&value)?);
        return Ok(());
    }
    print_counts(&summary);
    let (megabytes, files) = (manifest.bytes() as f64 / 1e6, manifest.files.len());
    println!("seed {}, {}", manifest.inputs.config.seed, manifest.generator);
    println!("{files} files, {megabytes:.1} MB, hash {}", manifest.hash);
    Ok(())
}

/// What was counted, object by object.
fn print_counts(summary: &std::collections::BTreeMap<String, Summary>) {
    let percent = |[k, n]: [usize; 2]| format!("{k} of {n} ({:.1} %)", share(k, n));
    for (name, s) in summary {
        println!("{name}: kept {} attempts", percent([s.kept(), s.attempts()]));
        println!("  {:?}", s.fates);
        println!(
            "  enough at {} poses; least sector of yaw {:.0} %, least quarter {:.0} %; {} out of reach",
            percent([s.enough, s.poses]),
            100.0 * s.least_sector,
            100.0 * s.least_quarter,
            s.out_of_reach
        );
        println!("  poses by grasp {:?}, greatest jump {:.2} rad", s.grasps, s.jump);
        println!(
            "  replayed with arm and hand before any filter: lifted {}",
            percent(s.unfiltered)
        );
        for (what, [[a, b], [c, d]]) in [("brief", s.agreement), ("2 s and shaken", s.endurance)] {
            println!(
                "  hand alone agrees with arm and hand ({what}): {} [{a} {b}; {c} {d}]",
                percent([a + d, a + b + c + d])
            );
        }
        println!("  kept ones, perturbed: lifted {}", percent(s.perturbed));
        println!(
            "  {:.2} s ({:.2}), jerk {:.0} rad/s3 ({:.0}), slip {:.1} mm ({:.1}): median (9 of 10)",
            s.seconds[0],
            s.seconds[1],
            s.jerk[0],
            s.jerk[1],
            1e3 * s.slip[0],
            1e3 * s.slip[1]
        );
        println!(
            "  least gap up to touch {:.2} mm, median {:.2} mm",
            1e3 * s.clearance[0],
            1e3 * s.clearance[1]
        );
        println!(
            "  targets that the arm reaches: arrived at {} (3 cm, 0.2 rad); restarts at most {}",
            percent(s.arrived),
            s.restarts
        );
    }
}

fn share(k: usize, n: usize) -> f64 {
    100.0 * k as f64 / n.max(1) as f64
}

fn show(dir: &Path, out: Option<&Path>) -> Result<()> {
    let (dataset, robot) = (Dataset::open(dir)?, Robot::standard()?);
    // Of an object that is not built in, everything is drawn but itself.
    let manifest = Manifest::read(dir)?;
    let known = dataset.config.objects.iter().filter_map(|name| {
        let object = dataset::generate::built_in_object(name).ok()?;
        let is_it = manifest.inputs.objects.get(name) == Some(&object.hash());
        is_it.then(|| (name.clone(), object))
    });
    let page = dataset::report::report(&dataset, &robot, &known.collect())?;
    let file = out.map_or_else(|| dir.join("report.html"), Path::to_path_buf);
    dataset::store::write(&file, page.as_bytes())?;
    println!("{}", file.display());
    Ok(())
}

fn episode(dir: &Path, index: usize, out: &Path) -> Result<()> {
    let file = Dataset::open(dir)?.demonstration(index)?;
    dataset::store::write(out, &serde_json::to_vec(&file)?)
}

fn verify(dir: &Path) -> Result<()> {
    let dataset = Dataset::open(dir)?;
    let bar = Bar::new("verify", 0);
    let rows = dataset.verify(&|done, total| bar.go(done, total))?;
    bar.clear();
    println!("{}: all files have their hashes, {rows} rows satisfy Eq. 6 and 7", dir.display());
    Ok(())
}
