#include "smartsurf/run/options/RenderOptions.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

const std::vector<std::string> kCameras = {"top", "iso", "side"};
const std::vector<std::string> kPalettes(view::kPaletteNames.begin(), view::kPaletteNames.end());

std::size_t index_of(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) - names.begin();
}

const std::vector<std::string> kStages(view::kStageNames.begin(), view::kStageNames.end());
const std::vector<std::string> kQualities = {"auto", "high", "medium", "low", "final"};

constexpr int kMaxSamples = 16384;
constexpr int kMinEdge = 16, kMaxEdge = 8192;  // pixels

common::PixelSize parse_pixel_size(const std::string& text) {
  const std::optional<common::PixelSize> size = common::parse_size(text);
  if (!size || std::min(size->width, size->height) < kMinEdge ||
      std::max(size->width, size->height) > kMaxEdge)
    throw scene::InputError("--picture-size " + text + ": must have the form 1600x1000, each edge from " +
                            std::to_string(kMinEdge) + " to " + std::to_string(kMaxEdge) + " pixels");
  return *size;
}

view::CameraView parse_camera(const std::string& text) {
  const std::size_t preset = index_of(kCameras, text);
  if (preset < kCameras.size()) return {static_cast<view::CameraPreset>(preset), {}};
  const std::optional<view::CameraPose> pose = view::parse_camera_pose(text);
  if (!pose)
    throw scene::InputError(
        "--camera " + text +
        ": must be top, iso, side, or X,Y,Z:X,Y,Z, a position and the lower point that it looks at");
  return {view::CameraPreset::kIso, pose};
}

}  // namespace

void add_render_flags(CLI::App& app, RenderFlags& flags) {
  app.add_option("--camera", flags.camera, "Camera: top, iso, side, or its position and what it looks at")
      ->type_name("VIEW|X,Y,Z:X,Y,Z");
  app.add_flag("--wires", flags.wireframe, "Draw objects as wireframes");
  app.add_option("--cells", flags.cells, "Colour the cells by this channel")->type_name("CHANNEL");
  app.add_option("--palette", flags.palette, "Palette of --cells")
      ->check(CLI::IsMember(kPalettes))
      ->type_name("NAME");
  app.add_option("--stage", flags.stage, "Ground, background and light: light or dark")
      ->check(CLI::IsMember(kStages))
      ->type_name("NAME");
  app.add_option("--quality", flags.quality,
                 "Rendering quality: low, medium, high, auto (what suits the driver) or final (path-traced)")
      ->check(CLI::IsMember(kQualities))
      ->type_name("NAME");
  app.add_option(
         "--aperture", flags.aperture,
         "With --quality final: lens diameter, u, focused on the camera's target (default: all in focus)")
      ->check(CLI::Range(0.0, 1e6))
      ->type_name("U");
  app.add_option("--samples", flags.samples, "With --quality final: paths per pixel (default: 32)")
      ->check(CLI::Range(1, kMaxSamples))
      ->type_name("N");
  app.add_option("--trails", flags.trails_s, "Draw trails of the last SECONDS")
      ->check(CLI::Range(0.0, 1e6))
      ->type_name("SECONDS");
  app.add_option(
         "--plot", flags.plots,
         "Plot a signal in the window: speed:ID (also x, y, z, spin), CHANNEL:ROW,COLUMN, contacts, objects, "
         "metric:NAME or the NAME of a metric alone")
      ->type_name("SIGNAL")
      ->allow_extra_args(false);
  app.add_option("--picture-size", flags.size,
                 "Size of pictures (default: 1600x1000) and videos (default: 1280x720) in pixels")
      ->type_name("WxH");
}

RenderOptions parse_render_options(const RenderFlags& flags) {
  RenderOptions options;
  options.view.camera = parse_camera(flags.camera);
  if (flags.wireframe) options.view.fill_mode = view::FillMode::kWireframe;
  options.view.stage = static_cast<view::Stage>(index_of(kStages, flags.stage));
  if (flags.quality != kQualities[0])
    options.view.detail = static_cast<view::Detail>(index_of(kQualities, flags.quality) - 1);
  const bool traced = options.view.detail == view::Detail::kFinal;
  if (!traced && (flags.aperture != 0.0 || flags.samples != view::kDefaultSamples))
    throw scene::InputError("--aperture and --samples: need --quality final");
  if (traced && flags.wireframe) throw scene::InputError("--wires: not with --quality final");
  options.aperture = flags.aperture;
  options.samples = flags.samples;
  view::OverlaySettings& overlay = options.view.overlay;
  overlay.channel = flags.cells;
  overlay.palette = view::kPalettes[index_of(kPalettes, flags.palette)];
  overlay.trails = flags.trails_s > 0.0;
  if (overlay.trails) overlay.trail_length_s = flags.trails_s;
  for (const std::string& text : flags.plots) {
    const std::optional<view::Signal> signal = view::parse_signal(text);
    if (!signal)
      throw scene::InputError(
          "--plot " + text +
          ": must be speed:ID (also x, y, z, spin), CHANNEL:ROW,COLUMN, contacts, objects or metric:NAME");
    options.view.plots.push_back(*signal);
    if (text == signal->quantity && signal->kind == view::Signal::Kind::kMetric)
      options.plotted_metrics.push_back(text);
  }
  if (!flags.size.empty()) options.pixel_size = parse_pixel_size(flags.size);
  return options;
}

}  // namespace smartsurf::run
