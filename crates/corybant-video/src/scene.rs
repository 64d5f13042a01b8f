//! Computes the numbers that the shader reads for each picture.
//!
//! In: a pose track and beats.
//! Out: one scene per picture.
//! Thread: any except show and audio.
//! Allocates: once; the buffers are reused.

use std::sync::Arc;

use glam::camera::rh::{proj::directx, view};
use glam::{Mat4, Vec3};

use super::Settings;
use crate::avatar::{Avatar, Costume, FLOATS_PER_VERTEX, Rig};
use crate::camera::{Camera, Shot};
use crate::figure::{self, FLOATS_PER_LIMB, Figure, Palette};
use crate::lights::{self, BEAMS_MAX, Music, RINGS, StageView};
use crate::pose_track::{Joints, PoseTrack};
use crate::view::{Frame, View};
use corybant_core::beat::offline::Beat;

/// Number of floats in [`Scene::whole`]: the numbers that the shader reads once for a picture.
/// `Scene` in `film.wgsl` defines their order.
pub const SCENE_FLOATS: usize =
    16 + 16 + 4 * (4 + COLOURS + 2 + 4 + RINGS + 2 * BEAMS_MAX + SHADES_MAX);
/// Number of colours of the look that the shader reads.
const COLOURS: usize = 8;
/// The greatest number of balls for all dancers together. The balls approximate the dancers'
/// bodies; the shader darkens the floor near the balls (ambient occlusion).
pub const SHADES_MAX: usize = 16;
/// The greatest number of balls for one dancer. The balls approximate the dancer's body; the shader
/// darkens the floor near the balls (ambient occlusion).
const SHADES_PER_DANCER: usize = 4;
/// Direction from the stage towards the key light (the main light), in stage space. Only the
/// direction of the vector is used.
const KEY: Vec3 = Vec3::new(-0.42, 0.80, 0.50);
/// Factor for the brightness of the key light (the main light) between beats; 1 is the normal
/// brightness.
const BRIGHT: f32 = 1.0;
/// Number that is added to the factor [`BRIGHT`] on a downbeat at full energy of the music. On
/// other beats and at lower energy, less is added.
const BRIGHTER: f32 = 0.22;
/// Constant part of the radius of the circle of light on the floor around the dancers, in metres.
/// The other part is a quarter of the distance of the camera in front of the stage.
const POOL: f32 = 2.2;
/// Width of the margin, in metres, that the shadow map covers around the part of the stage that the
/// dancers use.
const SHADOW_MARGIN: f32 = 0.3;
/// Radius of the filter that softens the edges of shadows, in texels of the shadow map.
const SOFT: f32 = 1.7;
/// Wanted resolution of the shadow map, in texels per metre of the stage. The resolution is lower
/// if the map would have to be larger than the largest of [`SHADOW_SIDES`].
const SHADOW_TEXELS_PER_METRE: f32 = 220.0;
/// The side lengths that the square shadow map can have, in texels, ascending.
const SHADOW_SIDES: [u32; 3] = [1024, 2048, 4096];
/// Greatest distance, in metres, at which a joint darkens the floor: around the point below the
/// joint, and around the joint's shadow. The value is for a body that is 1 m tall; it is multiplied
/// by the height of the body.
const SHADED_AROUND: f32 = 0.35;
/// The colours of up to eight dancers in linear RGB: for each, body, trim and visor. The ninth
/// dancer has the colours of the first, and so on.
const PALETTES: [Palette; 8] = [
    [
        [0.62, 0.13, 0.055],
        [0.66, 0.54, 0.44],
        [0.012, 0.012, 0.016],
    ],
    [
        [0.03, 0.30, 0.36],
        [0.60, 0.64, 0.64],
        [0.012, 0.012, 0.016],
    ],
    [
        [0.64, 0.36, 0.05],
        [0.36, 0.16, 0.07],
        [0.012, 0.012, 0.016],
    ],
    [
        [0.36, 0.20, 0.66],
        [0.64, 0.58, 0.68],
        [0.012, 0.012, 0.016],
    ],
    [
        [0.24, 0.52, 0.16],
        [0.64, 0.64, 0.50],
        [0.012, 0.012, 0.016],
    ],
    [
        [0.72, 0.14, 0.36],
        [0.68, 0.57, 0.59],
        [0.012, 0.012, 0.016],
    ],
    [
        [0.12, 0.26, 0.68],
        [0.56, 0.61, 0.68],
        [0.012, 0.012, 0.016],
    ],
    [
        [0.60, 0.60, 0.58],
        [0.16, 0.16, 0.18],
        [0.012, 0.012, 0.016],
    ],
];

/// All numbers that the shader reads for one picture.
#[derive(Default)]
pub struct Scene {
    /// The numbers that are the same for the whole picture, in the order of `Scene` in `film.wgsl`.
    /// Their count is [`SCENE_FLOATS`].
    pub whole: Vec<f32>,
    /// The numbers of all limb segments of all dancers:
    /// [`FLOATS_PER_LIMB`] for each segment.
    pub pieces: Vec<f32>,
    /// For each dancer with an avatar: its skinned vertices, six floats for each.
    pub skins: Vec<Vec<f32>>,
    /// Which parts of the picture show the floor, its shadows and the dancers.
    pub seen: View,
}

/// A dancer's avatar and its rig.
pub(crate) struct Dressed {
    pub avatar: Arc<Avatar>,
    pub rig: Rig,
}

/// A builder that computes the scene (the shader's numbers) of each picture of a video.
pub struct SceneBuilder<'a> {
    track: &'a PoseTrack,
    beats: &'a [Beat],
    figures: Vec<Figure>,
    /// One entry for each dancer; `None` for a dancer without an avatar.
    dressed: Vec<Option<Dressed>>,
    camera: Camera,
    settings: Settings,
    aspect: f32,
    /// Half the side length, in metres, of the square of the stage that the shadow map covers.
    lit_radius: f32,
    joints: Vec<Joints>,
    scene: Scene,
}

impl<'a> SceneBuilder<'a> {
    /// Creates a builder of the scenes for the dance in `track`. The lights follow `beats`.
    /// `costumes` has the avatars of the dancers; a dancer without one, or without hips, has a plain figure. The
    /// positions in `track` become those of the avatars.
    pub fn new(
        track: &'a mut PoseTrack,
        beats: &'a [Beat],
        settings: Settings,
        costumes: &[Option<Costume>],
    ) -> Self {
        let mut dressed = Vec::new();
        for dancer in 0..track.skeletons().len() {
            let costume = costumes.get(dancer).and_then(Option::as_ref);
            let rig = costume.and_then(|costume| {
                let skeleton = &track.skeletons()[dancer];
                let rig = Rig::new(&costume.avatar, skeleton, costume.home)?;
                let avatar = costume.avatar.clone();
                Some(Dressed { avatar, rig })
            });
            if let Some(Dressed { rig, .. }) = &rig {
                track.set_scale(dancer, rig.scale());
            }
            dressed.push(rig);
        }
        let track = &*track;
        let mut figures: Vec<Figure> = track.skeletons().iter().map(Figure::new).collect();
        for (figure, dressed) in figures.iter_mut().zip(&dressed) {
            let size = dressed.as_ref().map(|dressed| dressed.rig.scale().size);
            figure.height *= size.unwrap_or(1.0);
        }
        let height = figures
            .iter()
            .map(|figure| figure.height)
            .fold(0.0, f32::max);
        let aspect = settings.size.width as f32 / settings.size.height as f32;
        let camera = Camera::new(settings.camera, track, beats, height, aspect);
        let lit_radius = camera.reach() + SHADOW_MARGIN;
        Self {
            track,
            beats,
            figures,
            dressed,
            camera,
            settings,
            aspect,
            lit_radius,
            joints: Vec::new(),
            scene: Scene::default(),
        }
    }

    /// Returns the avatars of the dancers that have one, in the order of [`Scene::skins`].
    pub fn avatars(&self) -> Vec<Arc<Avatar>> {
        let dressed = self.dressed.iter().flatten();
        dressed.map(|dressed| dressed.avatar.clone()).collect()
    }

    /// Returns half the side length, in metres, of the square of the stage that the shadow map
    /// covers.
    pub fn lit_radius(&self) -> f32 {
        self.lit_radius
    }

    /// Returns the scene (the shader's numbers) of the picture with the number `picture`, counted
    /// from 0.
    pub fn scene(&mut self, picture: usize) -> &Scene {
        self.track.joints(picture, &mut self.joints);
        let Scene { pieces, skins, .. } = &mut self.scene;
        pieces.clear();
        skins.resize_with(self.dressed.iter().flatten().count(), Vec::new);
        let mut skins = skins.iter_mut();
        for (n, (figure, joints)) in self.figures.iter().zip(&self.joints).enumerate() {
            match &mut self.dressed[n] {
                Some(Dressed { avatar, rig }) => {
                    rig.pose(avatar, joints);
                    skins.next().into_iter().for_each(|skin| {
                        skin.clear();
                        rig.skin(avatar, skin);
                    });
                }
                None => figure.draw(joints, &PALETTES[n % PALETTES.len()], pieces),
            }
        }
        self.scene.whole = self.scene_numbers(picture);
        self.scene.seen = self.view(&self.camera.shot(picture));
        &self.scene
    }

    /// Returns the numbers that are the same for the whole picture with the number `picture`, in
    /// the order of `Scene` in `film.wgsl`.
    fn scene_numbers(&self, picture: usize) -> Vec<f32> {
        let shot = self.camera.shot(picture);
        let (middle, distance) = self.camera.stage(picture);
        let light = shadow_view(middle, self.lit_radius);
        let music = Music::at(self.beats, self.track.time(picture));
        let (colours, key) = (self.settings.look.colours(), KEY.normalize());
        let shades = self.shades();
        let stage = StageView {
            view: shot.view(self.aspect),
            eye: shot.eye,
            middle,
            radius: POOL + 0.25 * distance,
        };
        let mut whole = Vec::with_capacity(SCENE_FLOATS);
        whole.extend(stage.view.to_cols_array());
        whole.extend(light.to_cols_array());
        whole.extend(shot.eye.extend(music.pulse).to_array());
        whole.extend(key.extend(BRIGHT + BRIGHTER * music.pulse).to_array());
        whole.extend([middle.x, middle.z, stage.radius, self.lit_radius]);
        whole.extend([
            (shades.len() / 4) as f32,
            SOFT / shadow_side(self.lit_radius) as f32,
            colours.pool,
            0.0,
        ]);
        let plain: [Vec3; COLOURS] = [
            colours.floor,
            colours.line,
            colours.lamp,
            colours.sky,
            colours.ground,
            colours.low,
            colours.high,
            colours.glow,
        ];
        plain
            .iter()
            .for_each(|colour| whole.extend(colour.extend(0.0).to_array()));
        lights::add_numbers(&mut whole, colours, &music, &stage);
        whole.extend(shades);
        whole.resize(SCENE_FLOATS, 0.0);
        whole
    }

    /// Returns which parts of the picture show the floor, its shadows and the dancers. `shot` is the
    /// position and direction of the camera.
    fn view(&self, shot: &Shot) -> View {
        let frame = Frame::new(shot, self.settings.size);
        let limbs = self.scene.pieces.as_chunks::<FLOATS_PER_LIMB>().0;
        let skins = self.scene.skins.iter();
        let vertices = skins.flat_map(|skin| skin.as_chunks::<FLOATS_PER_VERTEX>().0);
        let dancers = limbs
            .iter()
            .flat_map(figure::ends)
            .chain(vertices.map(|v| (Vec3::new(v[0], v[1], v[2]), 0.0)));
        let horizon = frame.horizon(shot);
        let floor = shadowed(&self.joints, &self.figures).map(|corner| (corner, 0.0));
        let [left, top, right, bottom] = frame.bounds(floor);
        View {
            horizon,
            near: [left, top.max(horizon), right, bottom.max(horizon)],
            dancers: frame.bounds(dancers),
        }
    }

    /// Returns balls that approximate the bodies of the dancers. The shader darkens the floor near
    /// the balls (ambient occlusion). Each ball is four numbers in metres: x, y, z and radius.
    fn shades(&self) -> Vec<f32> {
        let each = (SHADES_MAX / self.figures.len().max(1)).clamp(1, SHADES_PER_DANCER);
        let all = self
            .figures
            .iter()
            .zip(&self.joints)
            .flat_map(|(figure, joints)| figure.shades(joints, each));
        all.take(SHADES_MAX)
            .flat_map(|(at, radius)| [at.x, at.y, at.z, radius])
            .collect()
    }
}

/// Returns the side length of the shadow map, in texels. The map covers a square of the stage;
/// `lit_radius` is half the side length of this square, in metres.
pub fn shadow_side(lit_radius: f32) -> u32 {
    let wanted = (2.0 * lit_radius * SHADOW_TEXELS_PER_METRE) as u32;
    SHADOW_SIDES
        .into_iter()
        .find(|&side| side >= wanted)
        .unwrap_or(SHADOW_SIDES[SHADOW_SIDES.len() - 1])
}

/// Returns the matrix from stage space to the clip space of the shadow map. The middle of the map
/// is `target` (a point of the stage), rounded to whole texels so that the edges of shadows do not
/// flicker. `lit_radius` is half the side length of the map, in metres.
fn shadow_view(target: Vec3, lit_radius: f32) -> Mat4 {
    let turned = view::look_at_mat4(Vec3::ZERO, -KEY, Vec3::Y);
    let step = 2.0 * lit_radius / shadow_side(lit_radius) as f32;
    let middle = (turned.transform_point3(target) / step).round() * step;
    let (low, high) = (middle - lit_radius, middle + lit_radius);
    directx::orthographic(
        low.x,
        high.x,
        low.y,
        high.y,
        -middle.z - 2.0 * lit_radius,
        -middle.z + 2.0 * lit_radius,
    ) * turned
}

/// Returns the corners, in stage space (metres), of a rectangle of the floor. All shadows of the
/// dancers are inside it. `joints` and `figures` have one entry per dancer.
fn shadowed(joints: &[Joints], figures: &[Figure]) -> [Vec3; 4] {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (joints, figure) in joints.iter().zip(figures) {
        for &at in &joints.positions {
            // The points below a joint and at its shadow, with the area around both.
            let thrown = at - KEY * (at.y.max(0.0) / KEY.y);
            let around = Vec3::splat(SHADED_AROUND * figure.height);
            (low, high) = (
                low.min(at.min(thrown) - around),
                high.max(at.max(thrown) + around),
            );
        }
    }
    [
        [low.x, low.z],
        [low.x, high.z],
        [high.x, low.z],
        [high.x, high.z],
    ]
    .map(|[x, z]| Vec3::new(x, 0.0, z))
}
