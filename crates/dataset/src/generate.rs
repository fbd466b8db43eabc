//! Making a dataset: grasps, clouds, demonstrations of every pose, then all of it put together.
//!
//! Every file depends on configuration, objects and scene alone and is there as a whole or not at all, so a killed run
//! goes on by making what is missing.

use crate::clouds::Viewer;
use crate::demonstrations::Post;
use crate::folder::{CLOUDS_PER_FILE, Dataset};
use crate::manifest::{MANIFEST, Manifest};
use crate::part::Part;
use crate::poses::spread_pose;
use crate::store;
use anyhow::{Context, Result, bail};
use geometry::catalog::{base_of, exemplar_of};
use geometry::object::Object;
use geometry::proportions::Proportions;
use geometry::surface;
use grasps::search::{SearchConfig, search};
use grasps::sides::all_sides;
use grasps::transfer::transfer;
use grasps::{GraspSet, Robot, Setting, built_in};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Points on the surface of an object: so many that what is symmetric has symmetric moments.
const SURFACE: usize = 4096;

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
            self.make_surfaces(objects)?;
            self.make_clouds(&viewer, objects, observer)?;
            self.make_parts(&viewer, objects, observer)?;
            self.put_together(robot, objects, observer)?;
        }
        self.remove_parts()?;
        Manifest::read(&self.dir)
    }

    /// The grasps of every object.
    fn make_grasps(&self, robot: &Robot, objects: &Objects, observer: &dyn Observer) -> Result<()> {
        let names = &self.config.objects;
        let stage = Stage::new("grasps", names.len(), observer, |i| self.grasps_path(&names[i]));
        stage.make(|i| {
            let object = object(objects, &names[i])?;
            let mut set = self.grasps_of(robot, &names[i], object)?;
            set.grasps = all_sides(object, &set.grasps);
            Ok(serde_json::to_vec_pretty(&set)?)
        })
    }

    /// The grasps of one object: those of the project, carried over from what it is a variant of or from the exemplar of
    /// its family, or found by search.
    fn grasps_of(&self, robot: &Robot, name: &str, object: &Object) -> Result<GraspSet> {
        let (search_config, seed) = (SearchConfig::paper(robot), self.config.seed);
        let carried = |from: &str, variant: Option<u32>| -> Result<Option<GraspSet>> {
            let source = Object::built_in(from).zip(built_in::built_in(from));
            let Some((base, set)) = source else { return Ok(None) };
            let proportions = match variant {
                Some(variant) => Proportions::of_variant(variant),
                None => Proportions::of_sizes(base.size(), object.size()),
            };
            Ok(Some(transfer(robot, &base, &set, object, &proportions, &search_config, seed)?))
        };
        // A mesh of somebody else's may have the name of one of ours.
        let ours = Object::built_in(name).filter(|ours| ours.hash() == object.hash());
        let own = match ours.and_then(|_| base_of(name)) {
            Some((base, 0)) => built_in::built_in(base),
            Some((base, variant)) => carried(base, Some(variant))?,
            None => None,
        };
        let exemplar = exemplar_of(name).filter(|exemplar| *exemplar != name);
        match (own, exemplar.filter(|_| self.config.grasps_by_family)) {
            (Some(own), None) => Ok(own),
            (Some(own), Some(exemplar)) => {
                let first = carried(exemplar, None)?;
                Ok(first.map_or(own.clone(), |first| first.followed_by(own)))
            }
            (None, _) => Ok(search(robot, object, &search_config, seed, |_| ())?.0),
        }
    }

    /// The grasps of an object.
    pub fn grasps(&self, name: &str) -> Result<GraspSet> {
        let path = self.grasps_path(name);
        let bytes = store::read(&path)?;
        serde_json::from_slice(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    /// Points on the whole surface of each object that the encoder sees a part of.
    fn make_surfaces(&self, objects: &Objects) -> Result<()> {
        let path = self.surfaces_path();
        if path.exists() {
            return Ok(());
        }
        let surface = |name: &String| -> Result<Vec<f32>> {
            let points = surface::points(&object(objects, name)?.mesh, SURFACE);
            Ok(points.iter().flat_map(|point| point.to_array()).collect())
        };
        let names = &self.config.encoder_objects;
        let surfaces = names.iter().map(surface).collect::<Result<Vec<_>>>()?;
        let tensors: Vec<store::Named> = names
            .iter()
            .zip(&surfaces)
            .map(|(name, points)| (name.as_str(), vec![points.len() / 3, 3], points.as_slice()))
            .collect();
        store::write(&path, &store::encode(&tensors, None)?)
    }

    /// The encoder's clouds.
    fn make_clouds(
        &self,
        viewer: &Viewer,
        objects: &Objects,
        observer: &dyn Observer,
    ) -> Result<()> {
        let names = &self.config.encoder_objects;
        let files = self.cloud_files();
        let place = |i: usize| (&names[i / files], i % files);
        let path = |i| self.cloud_path(place(i).0, place(i).1);
        let stage = Stage::new("hundreds of clouds", files * names.len(), observer, path);
        stage.make(|i| {
            let (name, file) = place(i);
            let left = self.config.encoder_clouds - file * CLOUDS_PER_FILE;
            let mut rng = self.rng("cloud", name, file);
            viewer.anywhere(object(objects, name)?, left.min(CLOUDS_PER_FILE), &mut rng)
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
        let place = |i: usize| (i % names.len(), i / names.len());
        let path = |i| self.part_path(&names[place(i).0], place(i).1);
        let total = self.config.poses * names.len();
        let stage = Stage::new("object poses", total, observer, path);
        stage.make(|i| {
            let (which, index) = place(i);
            let (name, set) = (&names[which], &sets[which]);
            let pose = spread_pose(viewer.robot, which * self.config.poses + index);
            self.make_part(viewer, name, object(objects, name)?, set, (index, pose))?.encode()
        })
    }

    fn make_part(
        &self,
        viewer: &Viewer,
        name: &str,
        object: &Object,
        set: &GraspSet,
        (index, pose): (usize, [f32; 3]),
    ) -> Result<Part> {
        let robot = viewer.robot;
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
            index,
            rng: &|kind, index| self.rng(kind, name, index),
        };
        post.demonstrate(&mut part)?;
        Ok(part)
    }
}

/// Things of one kind, a file each, of which those are made that are missing.
pub(crate) struct Stage<'a, P> {
    name: &'a str,
    total: usize,
    missing: Vec<usize>,
    observer: &'a dyn Observer,
    path: P,
}

impl<'a, P: Fn(usize) -> PathBuf + Sync> Stage<'a, P> {
    /// Looks which of `total` files are missing.
    pub(crate) fn new(name: &'a str, total: usize, observer: &'a dyn Observer, path: P) -> Self {
        let missing: Vec<usize> = (0..total).filter(|i| !path(*i).exists()).collect();
        observer.progress(name, total - missing.len(), total);
        Self { name, total, missing, observer, path }
    }

    /// Writes the bytes that `make` gives for each.
    pub(crate) fn make(&self, make: impl Fn(usize) -> Result<Vec<u8>> + Sync + Send) -> Result<()> {
        self.write(|i, path| store::write(path, &make(i)?))
    }

    /// Lets `write` write each.
    pub(crate) fn write(
        &self,
        write: impl Fn(usize, &Path) -> Result<()> + Sync + Send,
    ) -> Result<()> {
        let done = AtomicUsize::new(self.total - self.missing.len());
        self.missing.par_iter().with_max_len(1).try_for_each(|&i| {
            if self.observer.is_stopped() {
                bail!("stopped; what is made is kept, and --resume goes on");
            }
            write(i, &(self.path)(i))?;
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            self.observer.progress(self.name, done, self.total);
            Ok(())
        })
    }
}

fn object<'a>(objects: &'a Objects, name: &str) -> Result<&'a Object> {
    objects.get(name).with_context(|| format!("there is no object named {name}"))
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
