#include "smartsurf/view/interaction/Controls.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace smartsurf::view {
namespace {

constexpr double kSlowest = 1.0 / 16.0, kFastest = 32.0;
constexpr double kClickPixels = 4.0;  // a press that travels no farther is a click

}  // namespace

Controls::Controls(const scene::SurfaceSpec& surface) : surface_(surface), tools_(surface) {
  frame(Preset::kIso);
}

void Controls::set_surface(const scene::SurfaceSpec& surface) {
  const bool same_size =
      surface.rows == surface_.rows && surface.columns == surface_.columns && surface.pitch == surface_.pitch;
  surface_ = surface;
  tools_ = Tools(surface);
  followed_.reset();
  if (!same_size) frame(preset_);
}

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
    case Key::kPause:
      commands_.toggle_pause = !commands_.toggle_pause;
      break;
    case Key::kStep:
      ++commands_.steps;
      break;
    case Key::kStepBack:
      --commands_.steps;
      break;
    case Key::kFaster:
      commands_.pace = faster(pace);
      break;
    case Key::kSlower:
      commands_.pace = slower(pace);
      break;
    case Key::kMaxPace:
      commands_.pace = pace > 0.0 ? 0.0 : 1.0;
      break;
    case Key::kReset:
      commands_.reset = status.resettable;
      break;
    case Key::kQuit:
      commands_.quit = true;
      break;
    default:
      change_view(key);
  }
}

void Controls::change_view(Key key) {
  switch (key) {
    case Key::kTop:
      return frame(Preset::kTop);
    case Key::kIso:
      return frame(Preset::kIso);
    case Key::kSide:
      return frame(Preset::kSide);
    case Key::kPicture:
      picture_ = true;
      break;
    case Key::kFilm:
      film_ = true;
      break;
    case Key::kFollow:
      if (followed_)
        followed_.reset();
      else if (tools_.selected() && tools_.selected()->kind == Thing::Kind::kObject)
        followed_ = tools_.selected()->object;
      break;
    case Key::kEscape:
      help_ = false;
      followed_.reset();
      tools_.escape();
      break;
    default:
      toggle_panels_and_layers(key);
  }
}

void Controls::toggle_panels_and_layers(Key key) {
  const auto toggle = [](bool& value) { value = !value; };
  switch (key) {
    case Key::kWireframe:
      style_ = style_ == Style::kSolid ? Style::kWireframe : Style::kSolid;
      break;
    case Key::kGrid:
      return toggle(grid_);
    case Key::kHelp:
      return toggle(help_);
    case Key::kPanels:
      return toggle(panels_);
    case Key::kLabels:
      return toggle(labels_);
    case Key::kTrails:
      return toggle(overlay_.trails);
    case Key::kForces:
      return toggle(overlay_.contacts);
    case Key::kSegments:
      return toggle(overlay_.sensor_segments);
    case Key::kNextChannel:
      return next_channel();
    default:
      break;
  }
}

void Controls::set_channels(std::span<const Channel> channels) {
  channels_.resize(channels.size());
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels_[i] != channels[i].name) channels_[i] = channels[i].name;
}

// None, the first, … the last, none.
void Controls::next_channel() {
  const auto now = std::find(channels_.begin(), channels_.end(), overlay_.channel);
  const auto next = now == channels_.end() ? channels_.begin() : now + 1;
  overlay_.channel = next == channels_.end() ? "" : *next;
}

void Controls::reset(std::vector<NamedValue> options) {
  commands_.reset = true;
  commands_.options = std::move(options);
}

void Controls::track(const scene::Snapshot& snapshot) {
  if (!followed_) return;
  const auto i = index_of(snapshot, *followed_);
  if (!i) return followed_.reset();
  const auto& p = snapshot.position[*i];
  camera_touched_ = true;
  camera_.look_at({p[0], p[1], p[2]});
}

Ray Controls::ray(const PointerEvent& event, double width, double height) const {
  return camera_.ray(event.x, event.y, width, height);
}

void Controls::point(const PointerEvent& event, const FrameInput& moment, const Status& status, double width,
                     double height) {
  const Ray sight = ray(event, width, height);
  const double dx = event.x - pointer_x_, dy = event.y - pointer_y_;
  pointer_x_ = event.x;
  pointer_y_ = event.y;
  switch (event.kind) {
    case PointerEvent::Kind::kPress: {
      const bool left = event.button == PointerEvent::Button::kLeft;
      travelled_ = 0.0;
      if (status.touchable && (left || event.control) && tools_.press(sight, moment, event.control))
        gesture_ = Gesture::kTool;
      else
        gesture_ = event.control ? Gesture::kNone : left && !event.shift ? Gesture::kOrbit : Gesture::kPan;
      break;
    }
    case PointerEvent::Kind::kMove:
      travelled_ += std::hypot(dx, dy);
      if (gesture_ == Gesture::kTool) tools_.move(sight, moment);
      if (travelled_ <= kClickPixels) break;
      if (gesture_ == Gesture::kOrbit) orbit_or_pan(PointerDrag::kOrbit, dx, dy, height);
      if (gesture_ == Gesture::kPan) orbit_or_pan(PointerDrag::kPan, dx, dy, height);
      break;
    case PointerEvent::Kind::kRelease:
      if (gesture_ == Gesture::kOrbit && travelled_ <= kClickPixels) tools_.select(sight, moment);
      tools_.release();
      gesture_ = Gesture::kNone;
      break;
  }
}

void Controls::orbit_or_pan(PointerDrag kind, double dx, double dy, double height) {
  camera_touched_ = true;
  if (kind == PointerDrag::kOrbit) return camera_.orbit(dx, dy);
  followed_.reset();
  camera_.pan(dx, dy, height);
}

void Controls::wheel(double notches) {
  camera_touched_ = true;
  camera_.zoom(notches);
}

void Controls::resize(double aspect, const Covered& covered) {
  if (aspect == aspect_ && covered == covered_) return;
  aspect_ = aspect;
  covered_ = covered;
  if (!camera_touched_) frame(preset_);
}

void Controls::frame(Preset preset) {
  preset_ = preset;
  followed_.reset();
  camera_ = Camera::framing(surface_, preset, aspect_, covered_);
  camera_touched_ = false;
}

Commands Controls::take() {
  Commands commands = std::exchange(commands_, {});
  commands.pull = tools_.pull();
  commands.poke = tools_.poke();
  commands.drop = tools_.take_drop();
  commands.fault = tools_.take_fault();
  return commands;
}

bool Controls::take_screenshot_request() { return std::exchange(picture_, false); }

bool Controls::take_video_request() { return std::exchange(film_, false); }

}  // namespace smartsurf::view
