// The scene of one frame for rays: the geometry that the OpenGL renderer draws, in Embree's trees.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/StageModel.h"

namespace smartsurf::view {

// The point at which a ray meets a surface. Normals point towards the ray's origin.
struct SurfacePoint {
  Eigen::Vector3f position;  // u
  Eigen::Vector3f normal;    // smooth
  Eigen::Vector3f face;      // of the geometry
  Eigen::Vector3f albedo;    // linear
  Finish finish{};
  float distance = 0.0F;  // from the ray's origin, u
  float opacity = 1.0F;   // share of the light that does not pass straight on
  float size = 1.0F;      // smallest half extent of the object, u
  bool unlit = false;     // the albedo is what is seen: lines and plumes
  bool ground = false;
  bool inside = false;  // met from behind
};

class TraceScene {
 public:
  explicit TraceScene(const scene::SceneSpec& spec);
  ~TraceScene();

  // Builds the trees of a frame; on one thread, so that they are the same in every run. pixel_slope: edge of
  // a pixel at distance 1.
  void update(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
              const Camera& camera, const DrawOptions& options, const StageLight& stage, float pixel_slope);

  // Which things a ray meets: those in any of the sets.
  enum Sets : unsigned { kOpaque = 1, kAcrylic = 2, kTranslucent = 4, kLines = 8, kAll = 15 };
  // Both may be called by several threads. direction: unit vector.
  bool intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, unsigned sets,
                 SurfacePoint& point) const;  // point: as constructed
  bool is_hidden(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, unsigned sets) const;

  // The offset of a ray's origin from a surface, against meeting it again, u.
  float offset() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::view
