// Builds small scenes for the tests of smartsurf/view.
#pragma once

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::view {

struct TestScene {
  scene::SceneSpec spec;
  scene::Snapshot snapshot;

  // rows × columns pins of length 2 and travel 0 to 6, all at `height`.
  explicit TestScene(int rows, int columns, float height = 4.0f) {
    spec.surface.rows = rows;
    spec.surface.columns = columns;
    snapshot.height.assign(spec.surface.cell_count(), height);
  }

  void add(const scene::ObjectSpec& object) {
    snapshot.id.push_back(static_cast<scene::ObjectId>(spec.objects.size()));
    const Eigen::Vector3f p = object.position.cast<float>();
    const Eigen::Quaternionf q = object.orientation.cast<float>();
    snapshot.position.push_back({p.x(), p.y(), p.z()});
    snapshot.orientation.push_back({q.x(), q.y(), q.z(), q.w()});
    snapshot.velocity.push_back({});
    snapshot.angular_velocity.push_back({});
    spec.objects.push_back(object);
  }

  void add_sphere(double x, double y, double z, double radius, const scene::Colour& colour) {
    scene::ObjectSpec sphere;
    sphere.position = {x, y, z};
    sphere.radius = radius;
    sphere.colour = colour;
    add(sphere);
  }
};

}  // namespace smartsurf::view
