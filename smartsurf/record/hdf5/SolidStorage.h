// Writes and reads /solids: each solid once, however many objects use it. Internal to this module.
//
// /solids/<n> has the attributes source, volume and inertia, and the datasets vertices and triangles (drawn),
// and corners, corner_count, face_count, face_size and face_corners (the convex hulls, concatenated; see
// docs/recordings.md).
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "smartsurf/record/hdf5/Hdf5.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {

class SolidWriter {
 public:
  explicit SolidWriter(hid_t file);
  // Writes the objects' solids that are not yet in the file.
  void add(std::span<const scene::ObjectSpec>);
  // The solid's number in the file, −1 for null. The solid must have been added.
  int solid_index(const std::shared_ptr<const scene::Solid>&) const;
  // Upper bound of the bytes that add() adds to the file.
  std::uint64_t max_bytes(std::span<const scene::ObjectSpec>) const;

 private:
  Handle group_;
  std::map<std::shared_ptr<const scene::Solid>, int> indices_;  // shared ownership keeps keys unique
};

// Reads all solids of the file, index = number; empty if there is no /solids. Throws Hdf5Error for data that
// no recorder writes: an index out of range, a hull that is not a polyhedron.
std::vector<std::shared_ptr<const scene::Solid>> read_solids(hid_t file);

}  // namespace smartsurf::record
