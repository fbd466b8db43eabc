//! Making a dataset: grasps, clouds, demonstrations of every pose, then all of it put together.
//!
//! Every file depends on the configuration alone and is there as a whole or not at all, so a killed run
//! goes on by making what is missing.

use crate::clouds::Viewer;
use crate::demonstrations::Post;
use crate::folder::{CLOUDS_PER_FILE, Dataset};
use crate::manifest::{MANIFEST, Manifest};
use crate::part::Part;
use crate::poses::spread_pose;
use crate::store;
use anyhow::{Context, Result, bail};
use geometry::object::Object;
use grasps::search::{GraspSet, SearchConfig, search};
use grasps::{Robot, Setting, built_in};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Objects by name.
pub type Objects = BTreeMap<String, Object>;

/// Is told how far the work is, and says whether it is to go on.
pub trait Observer: Sync {
    /// `done` of `total` things of a stage are made.
    fn progress(&self, stage: &str, done: usize, total: usize);

    /// Whether to stop at the next file.
    fn is_stopped(&self) -> bool;
}

/// Nobody who looks on.
pub struct Alone;

impl Observer for Alone {
    fn progress(&self, _: &str, _: usize, _: usize) {}

    fn is_stopped(&self) -> bool {
        false
    }
}

/// Object poses that are worked on in order before the next ones.
const BLOCK: usize = 4;

impl Dataset {
    /// Makes everything that is not there yet, on the threads of the current pool.
    pub fn generate(
        &self,
        robot: &Robot,
        objects: &Objects,
        observer: &dyn Observer,
    ) -> Result<Manifest> {
        if !self.dir.join(MANIFEST).exists() {
            let viewer = Viewer::new(robot);
            self.make_grasps(robot, objects, observer)?;
            self.make_clouds(&viewer, objects, observer)?;
            self.make_parts(&viewer, objects, observer)?;
            self.put_together(robot, objects, observer)?;
        }
        self.remove_parts()?;
        Manifest::read(&self.dir)
    }

    /// The grasps of every object: those of the project, or found by search.
    fn make_grasps(&self, robot: &Robot, objects: &Objects, observer: &dyn Observer) -> Result<()> {
        let done = AtomicUsize::new(0);
        let total = self.config.objects.len();
        observer.progress("grasps", 0, total);
        self.config.objects.par_iter().by_uniform_blocks(BLOCK).try_for_each(|name| {
            let path = self.grasps_path(name);
            if !path.exists() {
                go_on(observer)?;
                let object = object(objects, name)?;
                let set = match built_in::built_in(name) {
                    Some(set) => set,
                    None => {
                        let config = SearchConfig::paper(robot);
                        search(robot, object, &config, self.config.seed, |_| ())?.0
                    }
                };
                store::write(&path, &serde_json::to_vec_pretty(&set)?)?;
            }
            observer.progress("grasps", done.fetch_add(1, Ordering::Relaxed) + 1, total);
            Ok(())
        })
    }

    /// The grasps of an object.
    pub fn grasps(&self, name: &str) -> Result<GraspSet> {
        let path = self.grasps_path(name);
        let bytes =
            std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_slice(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    /// The encoder's clouds.
    fn make_clouds(
        &self,
        viewer: &Viewer,
        objects: &Objects,
        observer: &dyn Observer,
    ) -> Result<()> {
        let names = &self.config.encoder_objects;
        let (files, wanted) = (self.cloud_files(), self.config.encoder_clouds);
        let done = AtomicUsize::new(0);
        (0..files * names.len()).into_par_iter().try_for_each(|i| {
            let (name, file) = (&names[i / files], i % files);
            let count = CLOUDS_PER_FILE.min(wanted - file * CLOUDS_PER_FILE);
            let path = self.cloud_path(name, file);
            if !path.exists() {
                go_on(observer)?;
                let mut rng = self.rng("cloud", name, file);
                store::write(&path, &viewer.anywhere(object(objects, name)?, count, &mut rng)?)?;
            }
            let done = done.fetch_add(count, Ordering::Relaxed) + count;
            observer.progress("clouds", done, wanted * names.len());
            Ok(())
        })
    }

    /// Demonstrations, replays and clouds of every object pose.
    fn make_parts(
        &self,
        viewer: &Viewer,
        objects: &Objects,
        observer: &dyn Observer,
    ) -> Result<()> {
        let names = &self.config.objects;
        let sets = names.iter().map(|name| self.grasps(name)).collect::<Result<Vec<_>>>()?;
        let (done, total) = (AtomicUsize::new(0), self.config.poses * names.len());
        observer.progress("demonstrations", 0, total);
        let work: Vec<usize> = (0..total).collect();
        work.par_iter().by_uniform_blocks(BLOCK).try_for_each(|i| {
            let (which, index) = (i % names.len(), i / names.len());
            let name = &names[which];
            let path = self.part_path(name, index);
            if !path.exists() {
                go_on(observer)?;
                let part =
                    self.make_part(viewer, name, object(objects, name)?, &sets[which], index)?;
                store::write(&path, &part.encode()?)?;
            }
            observer.progress("demonstrations", done.fetch_add(1, Ordering::Relaxed) + 1, total);
            Ok(())
        })
    }

    fn make_part(
        &self,
        viewer: &Viewer,
        name: &str,
        object: &Object,
        set: &GraspSet,
        index: usize,
    ) -> Result<Part> {
        let robot = viewer.robot;
        let pose = spread_pose(robot, index);
        let mut part = Part { pose, ..Part::default() };
        let mut rng = self.rng("look", name, index);
        let counts = [self.config.turns, self.config.clouds];
        viewer.look_around(object, counts, &mut part, &mut rng)?;
        let [x, y, yaw] = pose;
        let post = Post {
            config: &self.config,
            name,
            grasps: &set.grasps,
            setting: Setting::new(robot, object, &robot.config.upright(x, y, yaw)),
            pose,
            rng: &|kind, index| self.rng(kind, name, index),
        };
        post.demonstrate(&mut part)?;
        Ok(part)
    }
}

fn object<'a>(objects: &'a Objects, name: &str) -> Result<&'a Object> {
    objects.get(name).with_context(|| format!("there is no object named {name}"))
}

/// An error if the work is to stop.
pub(crate) fn go_on(observer: &dyn Observer) -> Result<()> {
    if observer.is_stopped() {
        bail!("stopped; what is made is kept, and --resume goes on");
    }
    Ok(())
}

/// Built-in objects by name.
pub fn built_in_objects<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Objects> {
    names.into_iter().map(|name| Ok((name.to_owned(), built_in_object(name)?))).collect()
}

/// A built-in object, or an error that names those there are.
pub fn built_in_object(name: &str) -> Result<Object> {
    let known: Vec<&str> = geometry::catalog::CATALOG.iter().map(|entry| entry.name).collect();
    Object::built_in(name)
        .with_context(|| format!("there is no object named {name}; known are {}", known.join(", ")))
}
