// The drawing interface in a build with -DSMARTSURF_VIEW=OFF: every function throws scene::InputError.
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/view/output/OffscreenView.h"
#include "smartsurf/view/window/StartScreen.h"
#include "smartsurf/view/window/Window.h"

namespace smartsurf::view {
namespace {

[[noreturn]] void throw_not_built() {
  throw scene::InputError("this program was built without the view: configure with -DSMARTSURF_VIEW=ON");
}

}  // namespace

struct OffscreenView::State {};
void OffscreenView::require_available(Detail) { throw_not_built(); }
OffscreenView::OffscreenView(const scene::SceneSpec&, Detail) { throw_not_built(); }
OffscreenView::~OffscreenView() = default;
common::Image OffscreenView::render(const scene::Snapshot&, const std::vector<scene::ObjectSpec>&,
                                    const Camera&, const DrawOptions&, int, int) {
  throw_not_built();
}

common::Image render_image(const scene::SceneSpec&, const scene::Snapshot&,
                           const std::vector<scene::ObjectSpec>&, const Camera&, const DrawOptions&, int,
                           int) {
  throw_not_built();
}

struct Window::State {};
bool Window::display_available() { return false; }
Window::Window(const scene::SceneSpec&, const std::string&, int, int, WindowPlacement) { throw_not_built(); }
Window::~Window() = default;
Commands Window::render_frame(const FrameInput&, const Status&) { throw_not_built(); }
Commands Window::poll(const Status&) { throw_not_built(); }
common::Image Window::capture_scene(const FrameInput&, int, int) { throw_not_built(); }
common::Image Window::capture_frame(const FrameInput&, const Status&) { throw_not_built(); }
bool Window::needs_redraw() const { throw_not_built(); }
bool Window::wants_contacts() const { throw_not_built(); }
void Window::perform(UiAction) { throw_not_built(); }
void Window::add_pointer_event(const PointerEvent&) { throw_not_built(); }
void Window::apply(const ViewSettings&) { throw_not_built(); }
void Window::show_message(const std::string&) { throw_not_built(); }
void Window::set_scene(const scene::SceneSpec&, const std::string&) { throw_not_built(); }
void Window::move_to_left() { throw_not_built(); }

std::string choose_file(const StartContents&, const std::atomic<bool>&) { return ""; }

}  // namespace smartsurf::view
