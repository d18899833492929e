// Writes /objects: what every object is and how it started; one entry an object, in growing datasets, because
// a script may add objects at any time. Private to the room.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/Hdf5.h"
#include "smartsurf/record/Solids.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {

class CatalogueWriter {
 public:
  // `group` is /objects of `file`.
  CatalogueWriter(hid_t file, hid_t group, std::vector<scene::Material> materials);
  void append(std::span<const scene::ObjectSpec> objects);
  // The most that append() can add to the file.
  std::uint64_t most_bytes(std::span<const scene::ObjectSpec> objects) const;

 private:
  struct Field {
    std::string name;
    int width;  // 1: one value an object; else objects × width
    Handle type, dataset;
  };
  void add_field(hid_t group, const char* name, Handle type, int width);
  void write(const char* name, const void* values, hsize_t count);

  std::vector<scene::Material> materials_;
  SolidWriter solids_;
  std::vector<Field> fields_;
  hsize_t written_ = 0;
};

const char* name_of(scene::ShapeKind shape);
// False when no shape has this name.
bool shape_of(const std::string& name, scene::ShapeKind& shape);

}  // namespace smartsurf::record
