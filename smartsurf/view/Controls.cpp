#include "smartsurf/view/Controls.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace smartsurf::view {
namespace {

constexpr double kSlowest = 1.0 / 16.0, kFastest = 32.0;

}  // namespace

Controls::Controls(const scene::SurfaceSpec& surface) : surface_(surface) { frame(Preset::kIso); }

double Controls::faster(double pace) {
  if (pace <= 0.0 || pace >= kFastest) return 0.0;
  return std::max(kSlowest, std::exp2(std::floor(std::log2(pace) + 1e-9) + 1.0));
}

double Controls::slower(double pace) {
  if (pace <= 0.0) return kFastest;
  return std::clamp(std::exp2(std::ceil(std::log2(pace) - 1e-9) - 1.0), kSlowest, kFastest);
}

void Controls::press(Key key, const Status& status) {
  const double pace = commands_.pace.value_or(status.requested_pace);
  switch (key) {
    case Key::kPause: commands_.toggle_pause = !commands_.toggle_pause; break;
    case Key::kStep: ++commands_.steps; break;
    case Key::kFaster: commands_.pace = faster(pace); break;
    case Key::kSlower: commands_.pace = slower(pace); break;
    case Key::kMaxPace: commands_.pace = pace > 0.0 ? 0.0 : 1.0; break;
    case Key::kTop: frame(Preset::kTop); break;
    case Key::kIso: frame(Preset::kIso); break;
    case Key::kSide: frame(Preset::kSide); break;
    case Key::kWireframe: style_ = style_ == Style::kSolid ? Style::kWireframe : Style::kSolid; break;
    case Key::kGrid: grid_ = !grid_; break;
    case Key::kPicture: picture_ = true; break;
    case Key::kHelp: help_ = !help_; break;
    case Key::kQuit: commands_.quit = true; break;
  }
}

void Controls::drag(Drag kind, double dx, double dy, double height) {
  camera_touched_ = true;
  if (kind == Drag::kOrbit) camera_.orbit(dx, dy);
  else camera_.pan(dx, dy, height);
}

void Controls::wheel(double notches) {
  camera_touched_ = true;
  camera_.zoom(notches);
}

void Controls::resize(double aspect) {
  if (aspect == aspect_) return;
  aspect_ = aspect;
  if (!camera_touched_) frame(preset_);
}

void Controls::frame(Preset preset) {
  preset_ = preset;
  camera_ = Camera::framing(surface_, preset, aspect_);
  camera_touched_ = false;
}

Commands Controls::take() { return std::exchange(commands_, {}); }

bool Controls::take_picture_request() { return std::exchange(picture_, false); }

}  // namespace smartsurf::view
