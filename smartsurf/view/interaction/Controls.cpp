#include "smartsurf/view/interaction/Controls.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartsurf/view/model/TableBounds.h"

namespace smartsurf::view {
namespace {

constexpr double kMinPace = 1.0 / 16.0, kMaxPace = 32.0;
constexpr double kClickTolerance_px = 4.0;  // a press that moves farther is a drag

}  // namespace

Controls::Controls(const scene::SurfaceSpec& surface) : surface_(surface), tools_(surface) { apply_view({}); }

void Controls::set_surface(const scene::SurfaceSpec& surface) {
  const bool same_size =
      surface.rows == surface_.rows && surface.columns == surface_.columns && surface.pitch == surface_.pitch;
  surface_ = surface;
  tools_ = Tools(surface);
  followed_.reset();
  if (!same_size) apply_view({view_.preset, {}});
}

// The tolerance of 1e-9 absorbs rounding errors of log2 at exact powers of two.
double Controls::faster_pace(double pace) {
  if (pace <= 0.0 || pace >= kMaxPace) return 0.0;
  return std::max(kMinPace, std::exp2(std::floor(std::log2(pace) + 1e-9) + 1.0));
}

double Controls::slower_pace(double pace) {
  if (pace <= 0.0) return kMaxPace;
  return std::clamp(std::exp2(std::ceil(std::log2(pace) - 1e-9) - 1.0), kMinPace, kMaxPace);
}

void Controls::perform(UiAction action, const Status& status) {
  const double pace = commands_.pace.value_or(status.requested_pace);
  switch (action) {
    case UiAction::kPause:
      if (!status.run_ended) commands_.toggle_pause = !commands_.toggle_pause;
      break;
    case UiAction::kStep:
      ++commands_.steps;
      break;
    case UiAction::kStepBack:
      --commands_.steps;
      break;
    case UiAction::kFaster:
      commands_.pace = faster_pace(pace);
      break;
    case UiAction::kSlower:
      commands_.pace = slower_pace(pace);
      break;
    case UiAction::kMaxPace:
      commands_.pace = pace > 0.0 ? 0.0 : 1.0;
      break;
    case UiAction::kReset:
      commands_.reset = status.can_reset;
      break;
    case UiAction::kStopBridges:
      commands_.stop_bridges = true;
      break;
    case UiAction::kQuit:
      commands_.quit = true;
      break;
    default:
      perform_view_action(action);
  }
}

void Controls::perform_view_action(UiAction action) {
  switch (action) {
    case UiAction::kTop:
      return apply_view({CameraPreset::kTop, {}});
    case UiAction::kIso:
      return apply_view({CameraPreset::kIso, {}});
    case UiAction::kSide:
      return apply_view({CameraPreset::kSide, {}});
    case UiAction::kScreenshot:
      screenshot_requested_ = true;
      break;
    case UiAction::kVideo:
      video_requested_ = true;
      break;
    case UiAction::kFollow:
      if (followed_)
        followed_.reset();
      else if (tools_.selected() && tools_.selected()->kind == SceneItem::Kind::kObject)
        followed_ = tools_.selected()->object;
      break;
    case UiAction::kEscape:
      help_ = false;
      followed_.reset();
      tools_.cancel();
      break;
    default:
      toggle_display_option(action);
  }
}

void Controls::toggle_display_option(UiAction action) {
  const auto toggle = [](bool& value) { value = !value; };
  switch (action) {
    case UiAction::kWireframe:
      fill_mode_ = fill_mode_ == FillMode::kSolid ? FillMode::kWireframe : FillMode::kSolid;
      break;
    case UiAction::kGrid:
      return toggle(grid_);
    case UiAction::kHelp:
      return toggle(help_);
    case UiAction::kPanels:
      return toggle(panels_);
    case UiAction::kLabels:
      return toggle(labels_);
    case UiAction::kEntities:
      return toggle(entities_);
    case UiAction::kPlots:
      return toggle(plots_);
    case UiAction::kTrails:
      return toggle(overlay_.trails);
    case UiAction::kContactForces:
      return toggle(overlay_.contact_forces);
    case UiAction::kSensorRays:
      return toggle(overlay_.sensor_rays);
    case UiAction::kNextChannel:
      return select_next_channel();
    default:
      break;
  }
}

void Controls::set_channels(std::span<const Channel> channels) {
  channels_.resize(channels.size());
  for (std::size_t i = 0; i < channels.size(); ++i)
    if (channels_[i] != channels[i].name) channels_[i] = channels[i].name;
}

// Cycles through no channel, the first, …, the last.
void Controls::select_next_channel() {
  const auto current = std::find(channels_.begin(), channels_.end(), overlay_.channel);
  const auto next = current == channels_.end() ? channels_.begin() : current + 1;
  overlay_.channel = next == channels_.end() ? "" : *next;
}

void Controls::reset(std::vector<NamedValue> options) {
  commands_.reset = true;
  commands_.options = std::move(options);
}

void Controls::update_camera(const scene::Snapshot& snapshot,
                             const std::vector<scene::ObjectSpec>& catalogue) {
  if (fits_to_objects_) {
    fits_to_objects_ = false;
    fitted_corners_ = corners_of_objects_over(surface_, snapshot, catalogue);
    if (!camera_moved_) fit_camera();
  }
  if (!followed_) return;
  const auto i = find_object_index(snapshot, *followed_);
  if (!i) return followed_.reset();
  const auto& p = snapshot.position[*i];
  camera_moved_ = true;
  camera_.look_at({p[0], p[1], p[2]});
}

Ray Controls::pointer_ray(const PointerEvent& event, double width, double height) const {
  return camera_.ray(event.x, event.y, width, height);
}

void Controls::handle_pointer(const PointerEvent& event, const FrameInput& input, const Status& status,
                              double width, double height) {
  const Ray view_ray = pointer_ray(event, width, height);
  const double dx = event.x - pointer_x_, dy = event.y - pointer_y_;
  pointer_x_ = event.x;
  pointer_y_ = event.y;
  switch (event.kind) {
    case PointerEvent::Kind::kPress: {
      const bool left = event.button == PointerEvent::Button::kLeft;
      drag_distance_ = 0.0;
      if (status.accepts_interaction && (left || event.control) &&
          tools_.press(view_ray, input, event.control))
        gesture_ = Gesture::kTool;
      else
        gesture_ = event.control ? Gesture::kNone : left && !event.shift ? Gesture::kOrbit : Gesture::kPan;
      break;
    }
    case PointerEvent::Kind::kMove:
      drag_distance_ += std::hypot(dx, dy);
      if (gesture_ == Gesture::kTool) tools_.move(view_ray, input);
      if (drag_distance_ <= kClickTolerance_px) break;
      if (gesture_ == Gesture::kOrbit) orbit_or_pan(PointerDrag::kOrbit, dx, dy, height);
      if (gesture_ == Gesture::kPan) orbit_or_pan(PointerDrag::kPan, dx, dy, height);
      break;
    case PointerEvent::Kind::kRelease:
      if (gesture_ == Gesture::kOrbit && drag_distance_ <= kClickTolerance_px) tools_.select(view_ray, input);
      tools_.release();
      gesture_ = Gesture::kNone;
      break;
  }
}

void Controls::orbit_or_pan(PointerDrag kind, double dx, double dy, double height) {
  camera_moved_ = true;
  if (kind == PointerDrag::kOrbit) return camera_.orbit(dx, dy);
  followed_.reset();
  camera_.pan(dx, dy, height);
}

void Controls::handle_scroll(double notches) {
  camera_moved_ = true;
  camera_.zoom(notches);
}

void Controls::resize(double aspect) {
  if (aspect == aspect_) return;
  aspect_ = aspect;
  if (!camera_moved_) fit_camera();
}

void Controls::apply_view(const CameraView& view) {
  view_ = view;
  followed_.reset();
  fitted_corners_.clear();
  fits_to_objects_ = true;
  camera_moved_ = false;
  fit_camera();
}

void Controls::fit_camera() { camera_ = Camera::from_view(surface_, view_, aspect_, fitted_corners_); }

void Controls::apply(const ViewSettings& settings) {
  fill_mode_ = settings.fill_mode;
  overlay_ = settings.overlay;
  plots_ = !settings.plots.empty();
  apply_view(settings.camera);
}

bool Controls::paste_camera(std::string_view text) {
  const std::optional<CameraPose> pose = parse_camera_pose(text);
  if (!pose) return false;
  followed_.reset();
  camera_moved_ = true;
  camera_.set_pose(*pose);
  return true;
}

bool Controls::is_on(UiAction action) const {
  switch (action) {
    case UiAction::kWireframe:
      return fill_mode_ == FillMode::kWireframe;
    case UiAction::kGrid:
      return grid_;
    case UiAction::kLabels:
      return labels_;
    case UiAction::kEntities:
      return entities_;
    case UiAction::kPlots:
      return plots_;
    case UiAction::kTrails:
      return overlay_.trails;
    case UiAction::kContactForces:
      return overlay_.contact_forces;
    case UiAction::kSensorRays:
      return overlay_.sensor_rays;
    case UiAction::kNextChannel:
      return !overlay_.channel.empty();
    case UiAction::kFollow:
      return followed_.has_value();
    case UiAction::kPanels:
      return panels_;
    case UiAction::kHelp:
      return help_;
    default:
      return false;
  }
}

Commands Controls::take_commands() {
  Commands commands = std::exchange(commands_, {});
  commands.pull = tools_.pull();
  commands.poke = tools_.poke();
  commands.drop = tools_.take_drop();
  commands.fault = tools_.take_fault();
  return commands;
}

bool Controls::take_screenshot_request() { return std::exchange(screenshot_requested_, false); }

bool Controls::take_video_request() { return std::exchange(video_requested_, false); }

}  // namespace smartsurf::view
