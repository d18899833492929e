// An object or a cell of the scene, as the user selects it.
#pragma once

#include <optional>

#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::view {

struct SceneItem {
  enum class Kind { kObject, kCell };
  Kind kind = Kind::kCell;
  scene::ObjectId object = 0;  // kObject
  int row = 0, column = 0;     // kCell; from 0, row 0 north
  bool operator==(const SceneItem&) const = default;
};

// The object's index in the snapshot; empty if it is not there. O(log n).
std::optional<std::size_t> find_object_index(const scene::Snapshot& snapshot, scene::ObjectId id);

}  // namespace smartsurf::view
