//! Finds a renderer, and selects the graphics interfaces in which it is searched.
//!
//! In: the environment variable `WGPU_BACKEND`. Out: a renderer; the reason if nothing draws.
//! Thread: any except show and audio.

use wgpu::{Adapter, Backends, InstanceDescriptor, RequestAdapterOptions};

use crate::VideoError;

/// Returns the GPU, or a software renderer if there is no GPU.
///
/// # Errors
/// [`VideoError::NoAdapter`] if there is no renderer.
pub(crate) fn find_adapter() -> Result<Adapter, VideoError> {
    let named = std::env::var("WGPU_BACKEND").ok();
    let instance = wgpu::Instance::new(InstanceDescriptor {
        backends: backends(named.as_deref()),
        flags: wgpu::InstanceFlags::empty(),
        ..InstanceDescriptor::new_without_display_handle()
    });
    let wanted = RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    pollster::block_on(instance.request_adapter(&wanted)).map_err(|_| VideoError::NoAdapter {
        reason: no_interface(named.as_deref()),
    })
}

/// Returns the graphics interfaces to search. `named` is the value of the environment variable
/// `WGPU_BACKEND`; `None` if it is not set.
fn backends(named: Option<&str>) -> Backends {
    named.map_or(Backends::PRIMARY, Backends::from_comma_list)
}

/// Returns the reason why no renderer was found. `named` is as in [`backends`].
fn no_interface(named: Option<&str>) -> String {
    match named {
        Some(named) => format!(
            "WGPU_BACKEND is {named:?}, and nothing draws with that; remove it, or set it to vulkan, metal or dx12"
        ),
        None => "no Vulkan, Metal or Direct3D 12".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_selects_the_graphics_interface() {
        assert_eq!(backends(None), Backends::PRIMARY);
        assert_eq!(backends(Some("vulkan")), Backends::VULKAN);
        assert_eq!(
            backends(Some("dx12,metal")),
            Backends::DX12 | Backends::METAL
        );
        let reason = no_interface(Some("dx9"));
        assert!(reason.starts_with("WGPU_BACKEND is \"dx9\""), "{reason}");
    }
}
