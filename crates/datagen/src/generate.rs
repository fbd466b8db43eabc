//! Generation of a dataset: grasps, clouds and demonstrations of every pose, then assembly.
//!
//! Every file depends only on configuration, objects and scene, and is written atomically. A killed run
//! resumes by generating the missing files.

use crate::adapted_grasps::AdaptationSource;
use crate::clouds::CloudRenderer;
use crate::demonstrations::{PoseGrasps, PoseTask};
use crate::poses::low_discrepancy_pose;
use crate::shared_grasps::ConsistentGrasps;
use anyhow::{Context, Result, bail};
use configs::DatasetConfig;
use dataset::Dataset;
use dataset::dataset::CLOUDS_PER_FILE;
use dataset::shard::PoseShard;
use dataset_manifest::{MANIFEST_FILE, Manifest, Provenance};
use files::{atomic_file, tensors};
use geometry::surface_sampling;
use grasps::search::grasp_rating::{GraspRating, LOWERINGS};
use grasps::search::transfer::transfer;
use grasps::search::{SearchConfig, search};
use grasps::set::catalog;
use grasps::set::symmetry::expand_by_symmetry;
use grasps::{GraspSet, PlacedObject, RobotContext};
use objects::catalog::{Objects, parse_variant, reference_object};
use objects::object::Object;
use objects::shape_variant::ShapeVariant;
use objects::symmetry::symmetry_order;
use progress::Progress;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Surface points per object, enough for symmetric objects to have symmetric moments.
pub(crate) const SURFACE_POINTS: usize = 4096;

/// Provenance of a dataset of these objects in the current scene.
pub fn provenance(config: &DatasetConfig, objects: &Objects) -> Provenance {
    let hashes = objects.iter().map(|(name, object)| (name.clone(), object.hash()));
    let scene = scene::scene_hash();
    Provenance { config: config.clone(), scene, objects: hashes.collect() }
}

/// Creates the folder of a dataset of these objects, see [`Dataset::create`].
pub fn create(
    dir: &Path,
    config: &DatasetConfig,
    objects: &Objects,
    may_resume: bool,
) -> Result<Dataset> {
    Dataset::create(dir, &provenance(config, objects), may_resume)
}

/// Generates all missing files of a dataset on the current thread pool.
pub fn generate(
    dataset: &Dataset,
    robot: &RobotContext,
    objects: &Objects,
    progress: &(dyn Progress + Sync),
) -> Result<Manifest> {
    generate_from(dataset, None, robot, objects, progress)
}

/// Generates all missing files of a dataset whose grasps are adapted to a policy ([`DatasetConfig::adaptation`]). The
/// poses are those of the source.
pub fn adapt(
    dataset: &Dataset,
    source: AdaptationSource,
    robot: &RobotContext,
    objects: &Objects,
    progress: &(dyn Progress + Sync),
) -> Result<Manifest> {
    generate_from(dataset, Some(source), robot, objects, progress)
}

fn generate_from(
    dataset: &Dataset,
    source: Option<AdaptationSource>,
    robot: &RobotContext,
    objects: &Objects,
    progress: &(dyn Progress + Sync),
) -> Result<Manifest> {
    if !dataset.dir.join(MANIFEST_FILE).exists() {
        let lowered = LOWERINGS.map(|depth| robot.above_lowered_table(depth));
        let generator = Generator { dataset, robot, lowered, objects, progress };
        let consistent = match &source {
            Some(source) => generator.generate_adapted_grasps(source)?,
            None if dataset.config.consistent_grasps => generator.generate_consistent_grasps()?,
            None => {
                generator.generate_grasps(|name| dataset.grasps_path(name))?;
                ConsistentGrasps::default()
            }
        };
        generator.generate_surfaces()?;
        let renderer = CloudRenderer::new(robot);
        generator.generate_clouds(&renderer)?;
        generator.generate_shards(&renderer, &consistent)?;
        generator.assemble()?;
    }
    dataset.delete_shards()?;
    Manifest::read(&dataset.dir)
}

/// Reads the grasps of an object.
pub fn read_grasps(dataset: &Dataset, name: &str) -> Result<GraspSet> {
    read_json(&dataset.grasps_path(name))
}

/// Reads the ratings of an object's grasps; empty for datasets without them: those without
/// [`DatasetConfig::consistent_grasps`], and those of format versions before 25.
pub fn read_grasp_ratings(dataset: &Dataset, name: &str) -> Result<Vec<GraspRating>> {
    let path = dataset.ratings_path(name);
    if path.exists() { read_json(&path) } else { Ok(Vec::new()) }
}

/// Reads the grasps of an object, or their ratings.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let value = serde_json::from_slice(&atomic_file::read(path)?);
    value.with_context(|| format!("{} is damaged; delete it and resume", path.display()))
}

/// Writes the files of one dataset.
pub(crate) struct Generator<'a> {
    pub(crate) dataset: &'a Dataset,
    pub(crate) robot: &'a RobotContext,
    /// The robot above tables that are lower, by [`LOWERINGS`].
    pub(crate) lowered: [RobotContext; LOWERINGS.len()],
    pub(crate) objects: &'a Objects,
    pub(crate) progress: &'a (dyn Progress + Sync),
}

impl Generator<'_> {
    /// Writes the grasps of every object to `path`.
    pub(crate) fn generate_grasps(&self, path: impl Fn(&str) -> PathBuf + Sync) -> Result<()> {
        let names = &self.dataset.config.objects;
        let path = |i: usize| path(&names[i]);
        let stage = FileBatch::new("grasps", names.len(), self.progress, path);
        stage.write_bytes(|i| {
            let object = self.object(&names[i])?;
            let mut set = self.find_grasps(&names[i], object)?;
            set.grasps = expand_by_symmetry(object, &set.grasps);
            Ok(serde_json::to_vec_pretty(&set)?)
        })
    }

    /// Grasps of one object: bundled with the project, transferred from the base object of a variant or from
    /// the reference object of the family, or found by search.
    fn find_grasps(&self, name: &str, object: &Object) -> Result<GraspSet> {
        let (robot, config) = (self.robot, &self.dataset.config);
        let (search_config, seed) = (SearchConfig::paper(robot), config.seed);
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
        match (own, exemplar.filter(|_| config.share_family_grasps)) {
            (Some(own), None) => Ok(own),
            (Some(own), Some(exemplar)) => {
                let first = transferred(exemplar, None)?;
                Ok(first.map_or(own.clone(), |first| first.chain(own)))
            }
            (None, _) => Ok(search(robot, object, &search_config, seed, &|_| ())?.0),
        }
    }

    /// Writes points on the whole surface of each object of the encoder.
    fn generate_surfaces(&self) -> Result<()> {
        let path = self.dataset.surfaces_path();
        if path.exists() {
            return Ok(());
        }
        let surface = |name: &String| -> Result<Vec<f32>> {
            let mesh = &self.object(name)?.mesh;
            let points = surface_sampling::sample_surface(mesh, SURFACE_POINTS);
            Ok(points.iter().flat_map(|point| point.to_array()).collect())
        };
        let names = &self.dataset.config.encoder_objects;
        let surfaces = names.iter().map(surface).collect::<Result<Vec<_>>>()?;
        let tensors: Vec<tensors::NamedTensor> = names
            .iter()
            .zip(&surfaces)
            .map(|(name, points)| (name.as_str(), vec![points.len() / 3, 3], points.as_slice()))
            .collect();
        atomic_file::write(&path, &tensors::encode(&tensors, None)?)
    }

    /// Writes the training clouds of the encoder.
    fn generate_clouds(&self, renderer: &CloudRenderer) -> Result<()> {
        let names = &self.dataset.config.encoder_objects;
        let files = self.dataset.cloud_files();
        let location = |i: usize| (&names[i / files], i % files);
        let path = |i| self.dataset.cloud_path(location(i).0, location(i).1);
        let stage = FileBatch::new("point cloud files", files * names.len(), self.progress, path);
        stage.write_bytes(|i| {
            let (name, file) = location(i);
            let left = self.dataset.config.encoder_clouds - file * CLOUDS_PER_FILE;
            let mut rng = self.rng("cloud", name, file);
            renderer.render_random_poses(self.object(name)?, left.min(CLOUDS_PER_FILE), &mut rng)
        })
    }

    /// Writes a shard with demonstrations, replays and clouds for every object pose.
    fn generate_shards(
        &self,
        renderer: &CloudRenderer,
        consistent: &ConsistentGrasps,
    ) -> Result<()> {
        let (names, poses) = (&self.dataset.config.objects, self.dataset.config.poses);
        let sets = names.iter().map(|name| read_grasps(self.dataset, name));
        let sets = sets.collect::<Result<Vec<_>>>()?;
        let location = |i: usize| (i % names.len(), i / names.len());
        let path = |i| self.dataset.shard_path(&names[location(i).0], location(i).1);
        let stage = FileBatch::new("object poses", poses * names.len(), self.progress, path);
        stage.write_bytes(|i| {
            let (object, index) = location(i);
            let order = consistent.orders.get(object * poses + index);
            let ratings = consistent.ratings.get(object).map(Vec::as_slice).unwrap_or_default();
            let grasps = PoseGrasps { grasps: &sets[object].grasps, order, ratings };
            self.generate_shard(renderer, grasps, [object, index])?.encode()
        })
    }

    /// Pose x, y (m), yaw (rad) of an object, by the indices of both.
    pub(crate) fn pose(&self, object: usize, index: usize) -> [f32; 3] {
        low_discrepancy_pose(self.robot, object * self.dataset.config.poses + index)
    }

    /// Number of demonstrated poses of an object; the others have neither demonstrations nor clouds.
    pub(crate) fn num_demonstrated_poses(&self, object: &Object) -> usize {
        let DatasetConfig { poses, round_poses, .. } = self.dataset.config;
        // Objects of order 2 look the same after half a turn only.
        let is_round = symmetry_order(object) > 2;
        round_poses.filter(|_| is_round).map_or(poses, |round| round.min(poses))
    }

    fn generate_shard(
        &self,
        renderer: &CloudRenderer,
        grasps: PoseGrasps,
        [object, index]: [usize; 2],
    ) -> Result<PoseShard> {
        let config = &self.dataset.config;
        let (name, pose) = (config.objects[object].as_str(), self.pose(object, index));
        let object = self.object(name)?;
        let mut shard = PoseShard { pose, ..PoseShard::default() };
        let mut rng = self.rng("look", name, index);
        let counts = [config.num_azimuths, config.clouds];
        let is_demonstrated = index < self.num_demonstrated_poses(object)
            && renderer.render_azimuths(object, counts, &mut shard, &mut rng);
        if !is_demonstrated {
            shard.fill_empty(counts);
            return Ok(shard);
        }
        let task = PoseTask {
            config,
            name,
            grasps,
            placed: self.placed_above_tables(object, pose),
            pose,
            index,
            rng: &|kind, index| self.rng(kind, name, index),
        };
        task.demonstrate(&mut shard)?;
        Ok(shard)
    }

    /// The object at a pose x, y (m), yaw (rad), above each of the tables of [`Generator::lowered`].
    pub(crate) fn placed_above_tables<'a>(
        &'a self,
        object: &'a Object,
        [x, y, yaw]: [f32; 3],
    ) -> [PlacedObject<'a>; LOWERINGS.len()] {
        let place = |robot: &'a RobotContext| {
            PlacedObject::new(robot, object, &robot.config.object_pose(x, y, yaw))
        };
        self.lowered.each_ref().map(place)
    }

    pub(crate) fn object(&self, name: &str) -> Result<&Object> {
        self.objects.get(name).with_context(|| format!("no object named {name}"))
    }

    /// Independent random generator for each generated item, so that the order of the work has no effect.
    fn rng(&self, kind: &str, name: &str, index: usize) -> ChaCha8Rng {
        let key = format!("{} {kind} {name} {index}", self.dataset.config.seed);
        ChaCha8Rng::from_seed(*blake3::hash(key.as_bytes()).as_bytes())
    }
}

/// A batch of files of one kind, of which the missing ones are written.
pub(crate) struct FileBatch<'a, P> {
    stage: &'a str,
    total: usize,
    missing: Vec<usize>,
    progress: &'a (dyn Progress + Sync),
    path: P,
}

impl<'a, P: Fn(usize) -> PathBuf + Sync> FileBatch<'a, P> {
    /// Finds the missing files among `total` paths.
    pub(crate) fn new(
        name: &'a str,
        total: usize,
        progress: &'a (dyn Progress + Sync),
        path: P,
    ) -> Self {
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
