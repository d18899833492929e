// Reads untrusted datasets: every size is checked against the file before memory is allocated. Internal to
// this module. Every function throws Hdf5Error (one line, naming the dataset).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "smartsurf/record/Recorder.h"
#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

// Opens a file that another process may still be writing.
Handle open_for_reading(const std::filesystem::path& path);
Handle open_group(hid_t parent, const char* name);
// A dataset that is stored in another file is refused.
Handle open_dataset(hid_t parent, const std::string& name);
Handle open_dataset(hid_t parent, const std::string& name, int rank);
// The bytes that a dataset takes in the file: at most the file's size, whatever the dataset declares.
hsize_t stored_bytes(hid_t dataset);
// Throws if `count` entries cannot come from what the file stores, compressed as well as can be.
void require_stored(hid_t dataset, hsize_t count, const std::string& name);
// Number of entries along the first axis of an uncompressed dataset that the file really stores. The extent
// alone is not trustworthy.
hsize_t stored_entries(hid_t dataset, std::size_t bytes_per_entry);
// Reads the first `count` entries of a dataset of strings.
std::vector<std::string> read_strings(hid_t parent, const std::string& name, hsize_t count);

// Reads the attributes of a group, all strings or all single numbers, sorted by name.
std::vector<NamedText> read_string_attributes(hid_t parent, const char* group_name);
std::vector<NamedNumber> read_number_attributes(hid_t parent, const char* group_name);

// Reads the block at `start` with extents `size`, whose product the caller must keep from overflowing.
template <class Number>
std::vector<Number> read_block(hid_t dataset, std::vector<hsize_t> start, const std::vector<hsize_t>& size,
                               const std::string& name) {
  hsize_t count = 1;
  for (const hsize_t n : size) count *= n;
  require_stored(dataset, count, name);
  std::vector<Number> values(count);
  if (count == 0) return values;
  require_memory(0);
  const Handle file(H5Dget_space(dataset), H5Sclose, name);
  check(H5Sselect_hyperslab(file, H5S_SELECT_SET, start.data(), nullptr, size.data(), nullptr),
        "dataset " + name + " is too short");
  const Handle memory(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose, name);
  check(H5Dread(dataset, native_type<Number>(), memory, file, H5P_DEFAULT, values.data()),
        "dataset " + name + " cannot be read");
  return values;
}

// Reads the first `count` entries, of `width` numbers each. The caller must bound both.
template <class Number>
std::vector<Number> read_column(hid_t parent, const std::string& name, hsize_t count, hsize_t width = 1) {
  const Handle dataset = open_dataset(parent, name, width == 1 ? 1 : 2);
  if (width == 1) return read_block<Number>(dataset, {0}, {count}, name);
  if (extents(dataset)[1] != width) throw Hdf5Error("dataset " + name + " has the wrong width");
  return read_block<Number>(dataset, {0, 0}, {count, width}, name);
}

}  // namespace smartsurf::record
