#include "smartsurf/view/model/SceneItem.h"

#include <algorithm>

namespace smartsurf::view {

std::optional<std::size_t> find_object_index(const scene::Snapshot& snapshot, scene::ObjectId id) {
  const auto found = std::lower_bound(snapshot.id.begin(), snapshot.id.end(), id);
  if (found == snapshot.id.end() || *found != id) return std::nullopt;
  return found - snapshot.id.begin();
}

}  // namespace smartsurf::view
