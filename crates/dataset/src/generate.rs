//! Generation of a dataset: grasps, clouds and demonstrations of every pose, then assembly.
//!
//! Every file depends only on configuration, objects and scene, and is written atomically. A killed run
//! resumes by generating the missing files.

use crate::clouds::CloudRenderer;
use crate::dataset::{CLOUDS_PER_FILE, Dataset};
use crate::demonstrations::PoseTask;
use crate::poses::low_discrepancy_pose;
use crate::shard::PoseShard;
use anyhow::{Context, Result, bail};
use dataset_manifest::{MANIFEST_FILE, Manifest};
use files::{atomic_file, tensors};
use geometry::surface_sampling;
use grasps::search::{SearchConfig, search};
use grasps::symmetry::expand_by_symmetry;
use grasps::transfer::transfer;
use grasps::{GraspSet, PlacedObject, RobotContext, catalog};
use objects::catalog::{parse_variant, reference_object};
use objects::object::Object;
use objects::shape_variant::ShapeVariant;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Surface points per object, enough for symmetric objects to have symmetric moments.
const SURFACE_POINTS: usize = 4096;

/// Objects by name.
pub type Objects = BTreeMap<String, Object>;

/// Progress callbacks, and cancellation.
pub trait Progress: Sync {
    /// Reports that `done` of `total` items of a stage are finished.
    fn update(&self, stage: &str, done: usize, total: usize);

    /// Whether generation must stop before the next file.
    fn is_stopped(&self) -> bool;
}

/// No-op implementation.
pub struct NoProgress;

impl Progress for NoProgress {
    fn update(&self, _: &str, _: usize, _: usize) {}

    fn is_stopped(&self) -> bool {
        false
    }
}

impl Dataset {
    /// Generates all missing files on the current thread pool.
    pub fn generate(
        &self,
        robot: &RobotContext,
        objects: &Objects,
        progress: &dyn Progress,
    ) -> Result<Manifest> {
        if !self.dir.join(MANIFEST_FILE).exists() {
            let viewer = CloudRenderer::new(robot);
            self.generate_grasps(robot, objects, progress)?;
            self.generate_surfaces(objects)?;
            self.generate_clouds(&viewer, objects, progress)?;
            self.generate_shards(&viewer, objects, progress)?;
            self.assemble(robot, objects, progress)?;
        }
        self.delete_shards()?;
        Manifest::read(&self.dir)
    }

    /// Writes the grasps of every object.
    fn generate_grasps(
        &self,
        robot: &RobotContext,
        objects: &Objects,
        progress: &dyn Progress,
    ) -> Result<()> {
        let names = &self.config.objects;
        let stage =
            FileBatch::new("grasps", names.len(), progress, |i| self.grasps_path(&names[i]));
        stage.write_bytes(|i| {
            let object = lookup_object(objects, &names[i])?;
            let mut set = self.find_grasps(robot, &names[i], object)?;
            set.grasps = expand_by_symmetry(object, &set.grasps);
            Ok(serde_json::to_vec_pretty(&set)?)
        })
    }

    /// Grasps of one object: bundled with the project, transferred from the base object of a variant or from
    /// the reference object of the family, or found by search.
    fn find_grasps(&self, robot: &RobotContext, name: &str, object: &Object) -> Result<GraspSet> {
        let (search_config, seed) = (SearchConfig::paper(robot), self.config.seed);
        let transferred = |from: &str, variant: Option<u32>| -> Result<Option<GraspSet>> {
            let source = Object::from_catalog(from).zip(catalog::catalog_grasps(from));
            let Some((base, set)) = source else { return Ok(None) };
            let proportions = match variant {
                Some(variant) => ShapeVariant::by_number(variant),
                None => ShapeVariant::between_sizes(base.size(), object.size()),
            };
            Ok(Some(transfer(robot, &base, &set, object, &proportions, &search_config, seed)?))
        };
        // A user mesh may have the name of a built-in object.
        let bundled =
            Object::from_catalog(name).filter(|built_in| built_in.hash() == object.hash());
        let own = match bundled.and_then(|_| parse_variant(name)) {
            Some((base, 0)) => catalog::catalog_grasps(base),
            Some((base, variant)) => transferred(base, Some(variant))?,
            None => None,
        };
        let exemplar = reference_object(name).filter(|exemplar| *exemplar != name);
        match (own, exemplar.filter(|_| self.config.share_family_grasps)) {
            (Some(own), None) => Ok(own),
            (Some(own), Some(exemplar)) => {
                let first = transferred(exemplar, None)?;
                Ok(first.map_or(own.clone(), |first| first.chain(own)))
            }
            (None, _) => Ok(search(robot, object, &search_config, seed, |_| ())?.0),
        }
    }

    /// Reads the grasps of an object.
    pub fn read_grasps(&self, name: &str) -> Result<GraspSet> {
        let path = self.grasps_path(name);
        let bytes = atomic_file::read(&path)?;
        serde_json::from_slice(&bytes).with_context(|| format!("{} is damaged", path.display()))
    }

    /// Writes points on the whole surface of each object of the encoder.
    fn generate_surfaces(&self, objects: &Objects) -> Result<()> {
        let path = self.surfaces_path();
        if path.exists() {
            return Ok(());
        }
        let surface = |name: &String| -> Result<Vec<f32>> {
            let points = surface_sampling::sample_surface(
                &lookup_object(objects, name)?.mesh,
                SURFACE_POINTS,
            );
            Ok(points.iter().flat_map(|point| point.to_array()).collect())
        };
        let names = &self.config.encoder_objects;
        let surfaces = names.iter().map(surface).collect::<Result<Vec<_>>>()?;
        let tensors: Vec<tensors::NamedTensor> = names
            .iter()
            .zip(&surfaces)
            .map(|(name, points)| (name.as_str(), vec![points.len() / 3, 3], points.as_slice()))
            .collect();
        atomic_file::write(&path, &tensors::encode(&tensors, None)?)
    }

    /// Writes the training clouds of the encoder.
    fn generate_clouds(
        &self,
        viewer: &CloudRenderer,
        objects: &Objects,
        progress: &dyn Progress,
    ) -> Result<()> {
        let names = &self.config.encoder_objects;
        let files = self.cloud_files();
        let location = |i: usize| (&names[i / files], i % files);
        let path = |i| self.cloud_path(location(i).0, location(i).1);
        let stage = FileBatch::new("point cloud files", files * names.len(), progress, path);
        stage.write_bytes(|i| {
            let (name, file) = location(i);
            let left = self.config.encoder_clouds - file * CLOUDS_PER_FILE;
            let mut rng = self.rng("cloud", name, file);
            viewer.render_random_poses(
                lookup_object(objects, name)?,
                left.min(CLOUDS_PER_FILE),
                &mut rng,
            )
        })
    }

    /// Writes a shard with demonstrations, replays and clouds for every object pose.
    fn generate_shards(
        &self,
        viewer: &CloudRenderer,
        objects: &Objects,
        progress: &dyn Progress,
    ) -> Result<()> {
        let names = &self.config.objects;
        let sets = names.iter().map(|name| self.read_grasps(name)).collect::<Result<Vec<_>>>()?;
        let location = |i: usize| (i % names.len(), i / names.len());
        let path = |i| self.shard_path(&names[location(i).0], location(i).1);
        let total = self.config.poses * names.len();
        let stage = FileBatch::new("object poses", total, progress, path);
        stage.write_bytes(|i| {
            let (which, index) = location(i);
            let (name, set) = (&names[which], &sets[which]);
            let pose = low_discrepancy_pose(viewer.robot, which * self.config.poses + index);
            self.generate_shard(viewer, name, lookup_object(objects, name)?, set, (index, pose))?
                .encode()
        })
    }

    fn generate_shard(
        &self,
        viewer: &CloudRenderer,
        name: &str,
        object: &Object,
        set: &GraspSet,
        (index, pose): (usize, [f32; 3]),
    ) -> Result<PoseShard> {
        let robot = viewer.robot;
        let mut shard = PoseShard { pose, ..PoseShard::default() };
        let mut rng = self.rng("look", name, index);
        let counts = [self.config.num_azimuths, self.config.clouds];
        viewer.render_azimuths(object, counts, &mut shard, &mut rng)?;
        let [x, y, yaw] = pose;
        let post = PoseTask {
            config: &self.config,
            name,
            grasps: &set.grasps,
            placed: PlacedObject::new(robot, object, &robot.config.object_pose(x, y, yaw)),
            pose,
            index,
            rng: &|kind, index| self.rng(kind, name, index),
        };
        post.demonstrate(&mut shard)?;
        Ok(shard)
    }
}

/// A batch of files of one kind, of which the missing ones are written.
pub(crate) struct FileBatch<'a, P> {
    stage: &'a str,
    total: usize,
    missing: Vec<usize>,
    progress: &'a dyn Progress,
    path: P,
}

impl<'a, P: Fn(usize) -> PathBuf + Sync> FileBatch<'a, P> {
    /// Finds the missing files among `total` paths.
    pub(crate) fn new(name: &'a str, total: usize, progress: &'a dyn Progress, path: P) -> Self {
        let missing: Vec<usize> = (0..total).filter(|i| !path(*i).exists()).collect();
        progress.update(name, total - missing.len(), total);
        Self { stage: name, total, missing, progress, path }
    }

    /// Writes the bytes that `make` returns for each missing file.
    pub(crate) fn write_bytes(
        &self,
        make: impl Fn(usize) -> Result<Vec<u8>> + Sync + Send,
    ) -> Result<()> {
        self.write_files(|i, path| atomic_file::write(path, &make(i)?))
    }

    /// Calls `write` with the index and the path of each missing file.
    pub(crate) fn write_files(
        &self,
        write: impl Fn(usize, &Path) -> Result<()> + Sync + Send,
    ) -> Result<()> {
        let done = AtomicUsize::new(self.total - self.missing.len());
        self.missing.par_iter().with_max_len(1).try_for_each(|&i| {
            if self.progress.is_stopped() {
                bail!("stopped; finished files are kept, use --resume to continue");
            }
            write(i, &(self.path)(i))?;
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            self.progress.update(self.stage, done, self.total);
            Ok(())
        })
    }
}

fn lookup_object<'a>(objects: &'a Objects, name: &str) -> Result<&'a Object> {
    objects.get(name).with_context(|| format!("no object named {name}"))
}

/// Loads built-in objects by name.
pub fn built_in_objects<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Objects> {
    names.into_iter().map(|name| Ok((name.to_owned(), built_in_object(name)?))).collect()
}

/// Loads a built-in object; the error lists the known names.
pub fn built_in_object(name: &str) -> Result<Object> {
    let known: Vec<&str> = objects::catalog::CATALOG.iter().map(|entry| entry.name).collect();
    Object::from_catalog(name)
        .with_context(|| format!("no object named {name}; known objects: {}", known.join(", ")))
}
