#include "smartsurf/view/output/OffscreenView.h"

#include <algorithm>
#include <cstring>

#include "common/gl/EglContext.h"
#include "smartsurf/view/gl/GlObjects.h"
#include "smartsurf/view/gl/Renderer.h"
#include "smartsurf/view/panels/LegendGui.h"

namespace smartsurf::view {
namespace {

constexpr int kMaxEdge = 8192;
constexpr float kHeightOfScaleOne = 720.0f;  // pixels, at which text has its plain size

}  // namespace

struct OffscreenView::State {
  State(const scene::SceneSpec& spec, Detail detail)
      : renderer(std::make_unique<Renderer>(spec,
                                            detail == Detail::kPicture ? Quality::fine() : Quality::video())),
        target(std::make_unique<Canvas>()),
        driver(reinterpret_cast<const char*>(glGetString(GL_RENDERER))) {
    context.release();
  }
  ~State() {
    context.make_current();
    legend.reset();
    renderer.reset();
    target.reset();
  }

  void draw_legend(const HeatScale& heat, int width, int height) {
    const float scale = std::max(0.5f, static_cast<float>(height) / kHeightOfScaleOne);
    if (!legend || legend->scale() != scale) legend = std::make_unique<LegendGui>(scale);
    legend->draw(heat, target->framebuffer.id(), width, height);
  }

  common::EglContext context;
  std::unique_ptr<Renderer> renderer;
  std::unique_ptr<Canvas> target;
  std::unique_ptr<LegendGui> legend;  // made when the first picture wants one
  std::string driver;
};

void OffscreenView::require_view() {}

OffscreenView::OffscreenView(const scene::SceneSpec& spec, Detail detail)
    : state_(std::make_unique<State>(spec, detail)) {}

OffscreenView::~OffscreenView() = default;

common::Image OffscreenView::draw(const scene::Snapshot& snapshot,
                                  const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                                  const DrawOptions& options, int width, int height) {
  if (width < 1 || height < 1 || width > kMaxEdge || height > kMaxEdge)
    throw scene::InputError("picture of " + std::to_string(width) + "x" + std::to_string(height) +
                            " pixels: each edge must be 1 to " + std::to_string(kMaxEdge));
  State& s = *state_;
  s.context.make_current();
  s.target->resize(width, height);
  s.renderer->draw(snapshot, catalogue, camera, options, s.target->framebuffer.id(), width, height);
  if (options.legend) s.draw_legend(*options.legend, width, height);
  common::Image image = read_pixels(s.target->framebuffer.id(), width, height);
  s.context.release();
  return image;
}

std::string OffscreenView::driver() const { return state_->driver; }

common::Image render_image(const scene::SceneSpec& spec, const scene::Snapshot& snapshot,
                           const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                           const DrawOptions& options, int width, int height) {
  return OffscreenView(spec).draw(snapshot, catalogue, camera, options, width, height);
}

}  // namespace smartsurf::view
