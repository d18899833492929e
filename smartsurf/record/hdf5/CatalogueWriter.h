// Writes /objects: the description and initial state of every object, one entry per object, in extendible
// datasets, because scripts may add objects at any time. Internal to this module.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/hdf5/Hdf5.h"
#include "smartsurf/record/hdf5/SolidStorage.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::record {

class CatalogueWriter {
 public:
  // `group` is /objects of `file`.
  CatalogueWriter(hid_t file, hid_t group, std::vector<scene::Material> materials);
  void append(std::span<const scene::ObjectSpec> objects);
  // Upper bound of the bytes that append() adds to the file.
  std::uint64_t max_bytes(std::span<const scene::ObjectSpec> objects) const;

 private:
  struct Column {
    std::string name;
    int width;  // numbers per object; the dataset has one axis if 1, else two: objects × width
    Handle type, dataset;
  };
  void add_column(hid_t group, const char* name, Handle type, int width);
  void write_column(const char* name, const void* values, hsize_t count);

  std::vector<scene::Material> materials_;
  SolidWriter solids_;
  std::vector<Column> columns_;
  hsize_t rows_written_ = 0;
};

const char* shape_name(scene::ShapeKind shape);
// Returns false if no shape has this name.
bool parse_shape(const std::string& name, scene::ShapeKind& shape);

}  // namespace smartsurf::record
