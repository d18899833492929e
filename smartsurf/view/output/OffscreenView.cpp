#include "smartsurf/view/output/OffscreenView.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <thread>

#include "common/gl/EglContext.h"
#include "smartsurf/view/gl/GlObjects.h"
#include "smartsurf/view/gl/Renderer.h"
#include "smartsurf/view/panels/LegendRenderer.h"
#include "smartsurf/view/trace/PathTracer.h"

namespace smartsurf::view {
namespace {

constexpr int kMaxEdge_px = 8192;
constexpr float kReferenceHeight_px = 720.0f;  // image height at which the legend has scale 1

RenderQuality quality_of(Detail detail) {
  switch (detail) {
    case Detail::kStill:
      return RenderQuality::fine();
    case Detail::kVideo:
      return RenderQuality::video();
    case Detail::kSmooth:
      return RenderQuality::smooth();
    case Detail::kFast:
    case Detail::kFinal:
      break;
  }
  return RenderQuality::preview();
}

}  // namespace

struct OffscreenView::State {
  State(const scene::SceneSpec& spec, Detail detail) {
    if (detail == Detail::kFinal) {
      tracer = std::make_unique<PathTracer>(spec);
      return;
    }
    open_context();
    renderer = std::make_unique<Renderer>(spec, quality_of(detail));
    context->release();
  }
  ~State() {
    if (!context) return;
    context->make_current();
    {
      const std::lock_guard lock(legends_mutex());
      legend_renderer.reset();
    }
    renderer.reset();
    target.reset();
  }

  // Leaves it current.
  void open_context() {
    if (context) return context->make_current();
    context = std::make_unique<common::EglContext>();
    target = std::make_unique<RenderTarget>();
  }

  // Dear ImGui has one current context for all threads.
  static std::mutex& legends_mutex() {
    static std::mutex mutex;
    return mutex;
  }

  void draw_legend(const ColourScale& colour_scale, int width, int height) {
    const std::lock_guard lock(legends_mutex());
    const float scale = std::max(0.5f, static_cast<float>(height) / kReferenceHeight_px);
    if (!legend_renderer || legend_renderer->scale() != scale)
      legend_renderer = std::make_unique<LegendRenderer>(scale);
    legend_renderer->draw(colour_scale, target->framebuffer.id(), width, height);
  }

  common::Image trace(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                      const Camera& camera, const DrawOptions& options, int width, int height) {
    const TraceSettings settings{options.samples, options.aperture,
                                 static_cast<int>(std::max(1U, std::thread::hardware_concurrency()))};
    const common::Image image = tracer->render(snapshot, catalogue, camera, options, settings, width, height);
    if (!options.legend) return image;
    open_context();
    target->resize(width, height);
    target->set_picture(image);
    draw_legend(*options.legend, width, height);
    return read_and_release(width, height);
  }

  common::Image read_and_release(int width, int height) {
    common::Image image = read_framebuffer(target->framebuffer.id(), width, height);
    context->release();
    return image;
  }

  std::unique_ptr<common::EglContext> context;  // a traced picture needs it for its legend alone
  std::unique_ptr<Renderer> renderer;
  std::unique_ptr<PathTracer> tracer;  // instead of the renderer
  std::unique_ptr<RenderTarget> target;
  std::unique_ptr<LegendRenderer> legend_renderer;  // created for the first image with a legend
};

void OffscreenView::require_available(Detail detail) {
  if (detail == Detail::kFinal) PathTracer::require_available();
}

OffscreenView::OffscreenView(const scene::SceneSpec& spec, Detail detail)
    : state_(std::make_unique<State>(spec, detail)) {}

OffscreenView::~OffscreenView() = default;

common::Image OffscreenView::render(const scene::Snapshot& snapshot,
                                    const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                                    const DrawOptions& options, int width, int height) {
  if (width < 1 || height < 1 || width > kMaxEdge_px || height > kMaxEdge_px)
    throw scene::InputError("picture of " + std::to_string(width) + "x" + std::to_string(height) +
                            " pixels: each edge must be 1 to " + std::to_string(kMaxEdge_px));
  State& s = *state_;
  if (s.tracer) return s.trace(snapshot, catalogue, camera, options, width, height);
  s.context->make_current();
  s.target->resize(width, height);
  s.renderer->draw(snapshot, catalogue, camera, options, s.target->framebuffer.id(), width, height);
  if (options.legend) s.draw_legend(*options.legend, width, height);
  return s.read_and_release(width, height);
}

common::Image render_image(const scene::SceneSpec& spec, const scene::Snapshot& snapshot,
                           const std::vector<scene::ObjectSpec>& catalogue, const Camera& camera,
                           const DrawOptions& options, int width, int height) {
  return OffscreenView(spec).render(snapshot, catalogue, camera, options, width, height);
}

}  // namespace smartsurf::view
