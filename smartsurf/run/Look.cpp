#include "smartsurf/run/Look.h"

#include <CLI/CLI.hpp>
#include <algorithm>

namespace smartsurf::run {
namespace {

const std::vector<std::string> kCameras = {"top", "iso", "side"};
const std::vector<std::string> kPalettes(view::kPaletteNames.begin(), view::kPaletteNames.end());

std::size_t index_in(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

}  // namespace

void add_look_flags(CLI::App& app, LookFlags& flags) {
  app.add_option("--camera", flags.camera, "Of pictures and videos: top, iso or side")
      ->check(CLI::IsMember(kCameras))
      ->type_name("VIEW");
  app.add_flag("--wires", flags.wires, "In pictures and videos: objects as wires");
  app.add_option("--cells", flags.cells, "In pictures and videos: the channel that colours the cells")
      ->type_name("CHANNEL");
  app.add_option("--palette", flags.palette, "Its palette")
      ->check(CLI::IsMember(kPalettes))
      ->type_name("NAME");
  app.add_option("--trails", flags.trails_s, "In pictures and videos: the objects' ways of the last seconds")
      ->check(CLI::Range(0.0, 1e6))
      ->type_name("SECONDS");
}

Look look_of(const LookFlags& flags) {
  Look look;
  look.camera = static_cast<view::Preset>(index_in(kCameras, flags.camera));
  look.wires = flags.wires;
  look.overlay.channel = flags.cells;
  look.overlay.palette = static_cast<view::Palette>(index_in(kPalettes, flags.palette));
  look.overlay.trails = flags.trails_s > 0.0;
  look.overlay.trail_s = flags.trails_s;
  return look;
}

}  // namespace smartsurf::run
