// Stands in for drawing in a build with -DSMARTSURF_VIEW=OFF: the same interface, which says that it is left
// out.
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/view/output/OffscreenView.h"
#include "smartsurf/view/window/Window.h"

namespace smartsurf::view {
namespace {

[[noreturn]] void left_out() {
  throw scene::InputError("this program was built without the view: configure with -DSMARTSURF_VIEW=ON");
}

}  // namespace

struct OffscreenView::State {};
void OffscreenView::require_view() { left_out(); }
OffscreenView::OffscreenView(const scene::SceneSpec&, Detail) { left_out(); }
OffscreenView::~OffscreenView() = default;
common::Image OffscreenView::draw(const scene::Snapshot&, const std::vector<scene::ObjectSpec>&,
                                  const Camera&, const DrawOptions&, int, int) {
  left_out();
}
std::string OffscreenView::driver() const { left_out(); }

common::Image render_image(const scene::SceneSpec&, const scene::Snapshot&,
                           const std::vector<scene::ObjectSpec>&, const Camera&, const DrawOptions&, int,
                           int) {
  left_out();
}

struct Window::State {};
bool Window::display_available() { return false; }
Window::Window(const scene::SceneSpec&, const std::string&, int, int, Place) { left_out(); }
Window::~Window() = default;
Commands Window::frame(const Moment&, const Status&) { left_out(); }
Commands Window::poll(const Status&) { left_out(); }
common::Image Window::picture(const Moment&, int, int) { left_out(); }
common::Image Window::show(const Moment&, const Status&) { left_out(); }
bool Window::stirred() const { left_out(); }
bool Window::wants_contacts() const { left_out(); }
void Window::press(Key) { left_out(); }
void Window::point(const PointerEvent&) { left_out(); }
void Window::set_scene(const scene::SceneSpec&) { left_out(); }

}  // namespace smartsurf::view
