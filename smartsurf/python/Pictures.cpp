#include "smartsurf/python/Pictures.h"

#include <algorithm>
#include <vector>

#include "common/error/UserError.h"
#include "smartsurf/view/output/RangeImage.h"

namespace smartsurf::python {

view::CameraView camera_view(const std::string& text) {
  view::CameraView view;
  if (text == "top" || text == "side")
    view.preset = text == "top" ? view::CameraPreset::kTop : view::CameraPreset::kSide;
  else if (text != "iso" && !(view.pose = view::parse_camera_pose(text)))
    throw common::UserError("camera = '" + text +
                            "': must be 'iso', 'top', 'side', or a position above a target");
  return view;
}

namespace {

view::Camera make_camera(const Environment& environment, const CameraChoice& choice, int width, int height) {
  view::Camera camera = view::Camera::from_view(environment.scene().surface, camera_view(choice.first),
                                                static_cast<double>(width) / std::max(height, 1));
  if (choice.second < 0) return camera;
  const scene::Snapshot& snapshot = environment.simulation().snapshot();
  const auto it = std::ranges::lower_bound(snapshot.id, static_cast<scene::ObjectId>(choice.second));
  if (it == snapshot.id.end() || *it != static_cast<scene::ObjectId>(choice.second))
    throw common::UserError("camera: object " + std::to_string(choice.second) + " is not alive");
  const auto& p = snapshot.position[it - snapshot.id.begin()];
  camera.look_at({p[0], p[1], p[2]});
  return camera;
}

}  // namespace

common::Image render(const Environment& environment, std::unique_ptr<view::OffscreenView>& view, int width,
                     int height, const CameraChoice& camera, bool fast) {
  view::OffscreenView::require_available();
  const scene::SceneSpec& scene = environment.scene();
  if (!view)
    view = std::make_unique<view::OffscreenView>(scene, fast ? view::Detail::kFast : view::Detail::kSmooth);
  return view->render(environment.simulation().snapshot(), environment.simulation().catalogue(),
                      make_camera(environment, camera, width, height), {}, width, height);
}

py::tuple render_range(const Environment& environment, int width, int height, const CameraChoice& camera) {
  view::RangeImage image;
  {
    py::gil_scoped_release release;
    image = view::capture_range(environment.scene().surface,
                                {environment.simulation().snapshot(), environment.simulation().catalogue()},
                                make_camera(environment, camera, width, height), width, height);
  }
  const std::vector<py::ssize_t> shape{height, width};
  return py::make_tuple(py::array_t<float>(shape, image.depth.data()),
                        py::array_t<std::int32_t>(shape, image.segmentation.data()));
}

py::array_t<std::uint8_t> to_array(const common::Image& image) {
  return py::array_t<std::uint8_t>({image.height, image.width, 3}, image.rgb.data());
}

}  // namespace smartsurf::python
