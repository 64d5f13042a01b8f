//! Renders scenes to pictures on the GPU.
//!
//! In: the numbers of a scene for the shader.
//! Out: pixels, some pictures later, so that rendering, readback and encoding overlap.
//! Thread: any except show and audio; the graphics driver has its own threads.
//! Allocates: picture buffers, which are reused.

mod passes;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{
    AddressMode, BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer,
    BufferUsages, CompareFunction, Device, DeviceDescriptor, FilterMode, MapMode, PollType, Queue,
    SamplerDescriptor, SubmissionIndex, TexelCopyBufferInfo, TexelCopyBufferLayout, Texture,
    TextureUsages, TextureView,
};

use super::{Background, Size, VideoError, mesh};
use crate::avatar::Avatar;
use crate::avatar_meshes::AvatarMeshes;
use crate::backends::find_adapter;
use crate::figure::FLOATS_PER_LIMB;
use crate::gpu::{buffer, divide_by_alpha, extent, record_error, texture, view};
use crate::pipelines::{COLOUR, DEPTH, Pipelines, SAMPLES};
use crate::scene::{SCENE_FLOATS, Scene, shadow_side};

/// The greatest number of pictures that the GPU renders or copies to memory at the same time.
const IN_FLIGHT: usize = 3;
/// Alignment, in bytes, of the rows of pixels in a buffer that is copied from the GPU: each row
/// starts at a multiple of this number.
const ROW_ALIGNMENT: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// The pixels of a picture: rows from the top, four bytes per pixel (red, green, blue, alpha). Alpha is 255
/// unless the background is transparent; the colours are not multiplied by it.
pub type Pixels = Arc<Vec<u8>>;

/// The GPU device with its resources, and the pictures that are being rendered.
pub struct Canvas {
    device: Device,
    queue: Queue,
    name: String,
    size: Size,
    background: Background,
    pipelines: Pipelines,
    mesh: Buffer,
    triangles: Buffer,
    corners: u32,
    colour: Texture,
    /// The picture of the dancers, with several samples for each pixel.
    sampled: TextureView,
    /// The shader resource with `sampled`.
    dancers: BindGroup,
    depth: TextureView,
    targets: Option<RenderTargets>,
    /// The avatars, in the order of `Scene::skins`.
    avatars: Vec<Arc<AvatarMeshes>>,
    in_flight: VecDeque<(usize, SubmissionIndex)>,
    next: usize,
    /// The first error that the graphics driver reported through a callback; `None` if there was
    /// none.
    device_error: Arc<Mutex<Option<String>>>,
    pool: Vec<Pixels>,
}

/// The GPU resources whose size depends on the first scene: on the number of limb segments, or on
/// how much of the stage the shadow map covers. They are created with that scene.
struct RenderTargets {
    shadow: TextureView,
    shadows: BindGroup,
    slots: Vec<Slot>,
    pieces: u32,
}

/// The GPU buffers for one picture that is being rendered or copied to memory.
struct Slot {
    scene: Buffer,
    group: BindGroup,
    pieces: Buffer,
    /// The skinned vertices of each avatar.
    skins: Vec<Buffer>,
    pixels: Buffer,
}

/// Returns the GPU, or the software renderer if there is no GPU, that [`Canvas::open`] uses: its
/// name, graphics interface and driver, as text for the user.
///
/// # Errors
/// [`VideoError::NoAdapter`] if there is no renderer.
pub fn adapter() -> Result<String, VideoError> {
    let info = find_adapter()?.get_info();
    let driver = [info.driver, info.driver_info].join(" ");
    Ok(format!(
        "{}, {}, {}",
        info.name,
        info.backend,
        driver.trim()
    ))
}

impl Canvas {
    /// Opens a GPU, or a software renderer if there is no GPU, and creates all resources for
    /// pictures of the size `size` with `background`. The environment variable `WGPU_BACKEND`, such as
    /// `WGPU_BACKEND=vulkan`, restricts the search to graphics interfaces.
    ///
    /// # Errors
    /// [`VideoError`] if there is no renderer or if it does not support the size.
    pub fn open(size: Size, background: Background) -> Result<Self, VideoError> {
        let adapter = find_adapter()?;
        let name = adapter.get_info().name;
        let max = adapter.limits().max_texture_dimension_2d;
        if size.width.max(size.height) > max {
            return Err(VideoError::TooLarge { name, max, size });
        }
        let limits = wgpu::Limits {
            max_texture_dimension_2d: max,
            ..wgpu::Limits::downlevel_defaults()
        };
        let wanted = DeviceDescriptor {
            label: None,
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&wanted)).map_err(|error| {
                VideoError::NoAdapter {
                    reason: format!("{name}: {error}"),
                }
            })?;
        let device_error = Arc::new(Mutex::new(None));
        let error_slot = device_error.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            record_error(&error_slot, error.to_string())
        }));
        let error_slot = device_error.clone();
        device.set_device_lost_callback(move |_, reason| record_error(&error_slot, reason));
        Self::ready((device, queue), name, (size, background), device_error)
    }

    fn ready(
        (device, queue): (Device, Queue),
        name: String,
        (size, background): (Size, Background),
        device_error: Arc<Mutex<Option<String>>>,
    ) -> Result<Self, VideoError> {
        let pipelines = Pipelines::new(&device);
        let (vertices, triangles) = (mesh::vertices(), mesh::triangles());
        let filled = |bytes: &[u8], usage: BufferUsages| {
            let buffer = buffer(&device, bytes.len(), usage | BufferUsages::COPY_DST);
            queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let mesh = filled(bytemuck::cast_slice(&vertices), BufferUsages::VERTEX);
        let corners = triangles.len() as u32;
        let triangles = filled(bytemuck::cast_slice(&triangles), BufferUsages::INDEX);
        let drawn = TextureUsages::RENDER_ATTACHMENT;
        let side = [size.width, size.height];
        let colour = texture(&device, side, COLOUR, 1, drawn | TextureUsages::COPY_SRC);
        let sampled = view(&texture(
            &device,
            side,
            COLOUR,
            SAMPLES,
            drawn | TextureUsages::TEXTURE_BINDING,
        ));
        let dancers = device.create_bind_group(&BindGroupDescriptor {
            label: None,
            layout: &pipelines.dancers,
            entries: &[BindGroupEntry {
                binding: 0,
                resource: BindingResource::TextureView(&sampled),
            }],
        });
        let depth = view(&texture(&device, side, DEPTH, SAMPLES, drawn));
        let canvas = Self {
            device,
            queue,
            name,
            size,
            background,
            pipelines,
            mesh,
            triangles,
            corners,
            colour,
            sampled,
            dancers,
            depth,
            targets: None,
            avatars: Vec::new(),
            in_flight: VecDeque::new(),
            next: 0,
            device_error,
            pool: Vec::new(),
        };
        canvas.check_device()?;
        Ok(canvas)
    }

    /// Returns the name of the GPU or software renderer.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Copies the avatars of the dancers that have one to the GPU, in the order of `Scene::skins`. Call it before
    /// `begin`.
    ///
    /// # Errors
    /// [`VideoError::Drawing`] if the driver fails.
    pub fn dress(&mut self, avatars: &[Arc<Avatar>]) -> Result<(), VideoError> {
        for (n, avatar) in avatars.iter().enumerate() {
            let same = avatars[..n]
                .iter()
                .position(|other| Arc::ptr_eq(other, avatar));
            let meshes = match same {
                Some(same) => self.avatars[same].clone(),
                None => Arc::new(AvatarMeshes::new(
                    &self.device,
                    &self.queue,
                    &self.pipelines,
                    avatar,
                )),
            };
            self.avatars.push(meshes);
        }
        self.check_device()
    }

    /// Returns the number of pictures that `begin` has started and `finish` has not yet returned.
    pub fn in_flight(&self) -> usize {
        self.in_flight.len()
    }

    /// Returns true if no further picture can be started, because `IN_FLIGHT` pictures are being
    /// rendered. Then `finish` must be called before the next `begin`.
    pub fn is_full(&self) -> bool {
        self.in_flight.len() == IN_FLIGHT
    }

    /// Begins to render the picture of `scene`. All scenes of a video must have the same number of
    /// limb segments. The shadow map covers a square of the stage; `lit_radius` is half the side
    /// length of this square, in metres. The `lit_radius` of the first scene determines the size of
    /// the map.
    ///
    /// # Errors
    /// [`VideoError::Drawing`] if the driver fails.
    pub fn begin(&mut self, scene: &Scene, lit_radius: f32) -> Result<(), VideoError> {
        let targets = self
            .targets
            .take()
            .unwrap_or_else(|| self.targets(scene.pieces.len(), lit_radius));
        let slot = &targets.slots[self.next];
        self.queue
            .write_buffer(&slot.scene, 0, bytemuck::cast_slice(&scene.whole));
        self.queue
            .write_buffer(&slot.pieces, 0, bytemuck::cast_slice(&scene.pieces));
        for (skin, vertices) in slot.skins.iter().zip(&scene.skins) {
            self.queue
                .write_buffer(skin, 0, bytemuck::cast_slice(vertices));
        }
        let mut commands = self.device.create_command_encoder(&Default::default());
        self.draw_shadows(&mut commands, &targets, slot);
        self.draw_dancers(&mut commands, &targets, slot);
        self.draw_picture(&mut commands, &targets, slot, scene.seen);
        let layout = TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(self.row()),
            rows_per_image: None,
        };
        let to = TexelCopyBufferInfo {
            buffer: &slot.pixels,
            layout,
        };
        commands.copy_texture_to_buffer(
            self.colour.as_image_copy(),
            to,
            extent([self.size.width, self.size.height]),
        );
        let submitted = self.queue.submit([commands.finish()]);
        let error_slot = self.device_error.clone();
        slot.pixels.map_async(MapMode::Read, .., move |result| {
            if let Err(error) = result {
                record_error(&error_slot, error.to_string());
            }
        });
        self.in_flight.push_back((self.next, submitted));
        self.next = (self.next + 1) % IN_FLIGHT;
        self.targets = Some(targets);
        self.check_device()
    }

    /// Waits for the oldest picture that is still being rendered and returns its pixels. Returns
    /// `None` if no picture is being rendered.
    ///
    /// # Errors
    /// [`VideoError::Drawing`] if the driver fails.
    pub fn finish(&mut self) -> Result<Option<Pixels>, VideoError> {
        let Some((slot, submitted)) = self.in_flight.pop_front() else {
            return Ok(None);
        };
        let waited = self.device.poll(PollType::Wait {
            submission_index: Some(submitted),
            timeout: None,
        });
        waited.map_err(|error| self.failed(error.to_string()))?;
        self.check_device()?;
        let mut pixels = self.unused();
        let Some(targets) = &self.targets else {
            return Ok(None);
        };
        let buffer = &targets.slots[slot].pixels;
        {
            let rows = buffer
                .get_mapped_range(..)
                .map_err(|error| self.failed(error.to_string()))?;
            if let Some(into) = Arc::get_mut(&mut pixels) {
                into.clear();
                rows.chunks_exact(self.row() as usize)
                    .for_each(|row| into.extend_from_slice(&row[..4 * self.size.width as usize]));
                if self.background == Background::Transparent {
                    divide_by_alpha(into);
                }
            }
        }
        buffer.unmap();
        self.pool.push(pixels.clone());
        Ok(Some(pixels))
    }

    /// Returns a pixel buffer that is no longer in use, or a new buffer.
    fn unused(&mut self) -> Pixels {
        let free = self
            .pool
            .iter_mut()
            .position(|pixels| Arc::get_mut(pixels).is_some());
        free.map_or_else(Pixels::default, |free| self.pool.swap_remove(free))
    }

    fn targets(&self, numbers: usize, lit_radius: f32) -> RenderTargets {
        let side = shadow_side(lit_radius);
        let usage = TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING;
        let shadow = view(&texture(&self.device, [side; 2], DEPTH, 1, usage));
        let sampler = self.device.create_sampler(&SamplerDescriptor {
            address_mode_u: AddressMode::ClampToEdge,
            address_mode_v: AddressMode::ClampToEdge,
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            compare: Some(CompareFunction::LessEqual),
            ..Default::default()
        });
        let shadows = self.device.create_bind_group(&BindGroupDescriptor {
            label: None,
            layout: &self.pipelines.shadows,
            entries: &[
                BindGroupEntry {
                    binding: 0,
                    resource: BindingResource::TextureView(&shadow),
                },
                BindGroupEntry {
                    binding: 1,
                    resource: BindingResource::Sampler(&sampler),
                },
            ],
        });
        let slots = (0..IN_FLIGHT).map(|_| self.slot(numbers)).collect();
        RenderTargets {
            shadow,
            shadows,
            slots,
            pieces: (numbers / FLOATS_PER_LIMB) as u32,
        }
    }

    fn slot(&self, numbers: usize) -> Slot {
        let make = |bytes, usage| buffer(&self.device, bytes, usage | BufferUsages::COPY_DST);
        let scene = make(4 * SCENE_FLOATS, BufferUsages::UNIFORM);
        let entries = [BindGroupEntry {
            binding: 0,
            resource: scene.as_entire_binding(),
        }];
        let group = self.device.create_bind_group(&BindGroupDescriptor {
            label: None,
            layout: &self.pipelines.scene,
            entries: &entries,
        });
        let pixels = make(
            (self.row() * self.size.height) as usize,
            BufferUsages::MAP_READ,
        );
        Slot {
            scene,
            group,
            skins: self
                .avatars
                .iter()
                .map(|avatar| avatar.vertex_buffer(&self.device))
                .collect(),
            pieces: make(4 * numbers.max(FLOATS_PER_LIMB), BufferUsages::VERTEX),
            pixels,
        }
    }

    /// Returns the length of a row of pixels in a buffer that is copied from the GPU, in bytes,
    /// including padding.
    fn row(&self) -> u32 {
        (4 * self.size.width).next_multiple_of(ROW_ALIGNMENT)
    }

    fn check_device(&self) -> Result<(), VideoError> {
        let device_error = self
            .device_error
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        device_error.map_or(Ok(()), |reason| Err(self.failed(reason)))
    }

    fn failed(&self, reason: String) -> VideoError {
        VideoError::Drawing {
            name: self.name.clone(),
            reason,
        }
    }
}
