// The path tracer in a build without Embree.
#include "smartsurf/view/trace/PathTracer.h"

namespace smartsurf::view {

struct TraceScene::State {};
TraceScene::TraceScene(const scene::SceneSpec&) {}
TraceScene::~TraceScene() = default;

void PathTracer::require_available() {
  throw scene::InputError(
      "--quality final: this program was built without Embree: install libembree-dev and configure again");
}
PathTracer::PathTracer(const scene::SceneSpec& spec) : spec_(spec), scene_(spec) { require_available(); }
PathTracer::~PathTracer() = default;
common::Image PathTracer::render(const scene::Snapshot&, const std::vector<scene::ObjectSpec>&, const Camera&,
                                 const DrawOptions&, const TraceSettings&, int, int) {
  return {};
}

}  // namespace smartsurf::view
