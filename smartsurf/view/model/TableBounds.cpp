#include "smartsurf/view/model/TableBounds.h"

#include <algorithm>

namespace smartsurf::view {

std::vector<Eigen::Vector3d> corners_of_objects_over(const scene::SurfaceSpec& surface,
                                                     const scene::Snapshot& snapshot,
                                                     const std::vector<scene::ObjectSpec>& catalogue) {
  Eigen::AlignedBox3d space = surface_bounding_box(surface);
  space.max().z() += space.sizes().head<2>().maxCoeff();
  std::vector<Eigen::Vector3d> corners;
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const Eigen::Vector3d at = Eigen::Map<const Eigen::Vector3f>(snapshot.position[i].data()).cast<double>();
    if (!space.contains(at)) continue;
    const Eigen::Quaterniond turned =
        Eigen::Map<const Eigen::Quaternionf>(snapshot.orientation[i].data()).cast<double>();
    const Eigen::Vector3d half = catalogue[snapshot.id[i]].half_extents();
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d sign(corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0);
      corners.push_back(at + turned * half.cwiseProduct(sign));
    }
  }
  return corners;
}

}  // namespace smartsurf::view
