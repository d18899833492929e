#include "smartsurf/record/hdf5/Hdf5Reading.h"

#include <algorithm>
#include <fstream>

#include "common/files/FileKind.h"
#include "common/files/Inputs.h"

namespace smartsurf::record {

namespace fs = std::filesystem;

Handle open_for_reading(const fs::path& path) {
  initialise_library();
  std::error_code error;
  if (!fs::exists(path, error)) throw Hdf5Error("no such file");
  if (!fs::is_regular_file(path, error)) throw Hdf5Error("is not a regular file");
  common::note_input(path);
  if (path.extension() == ".csv")
    throw Hdf5Error("is a CSV recording, which only holds trajectories: record to a name ending in .h5");
  if (H5Fis_hdf5(path.c_str()) <= 0) {
    const common::FileKind kind = common::file_kind(path);
    if (kind == common::FileKind::kExperiment)
      throw Hdf5Error("is an experiment, not a recording: smartsurf run " + path.string() +
                      " --record FILE.h5 makes one");
    if (kind != common::FileKind::kOther)
      throw Hdf5Error("is " + std::string(common::description(kind)) + ", not a recording");
    throw Hdf5Error("is not an HDF5 file: smartsurf run --record writes one");
  }
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "file properties");
  check(H5Pset_file_locking(access, false, true), "file properties");  // a running recorder holds the lock
  return Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose, "is damaged or truncated");
}

Handle open_group(hid_t parent, const char* name) {
  return Handle(H5Gopen2(parent, name, H5P_DEFAULT), H5Gclose, std::string("has no group ") + name);
}

Handle open_dataset(hid_t parent, const std::string& name) {
  Handle dataset(H5Dopen2(parent, name.c_str(), H5P_DEFAULT), H5Dclose, "has no dataset " + name);
  const Handle creation(H5Dget_create_plist(dataset), H5Pclose, "dataset " + name);
  if (H5Pget_layout(creation) == H5D_VIRTUAL || H5Pget_external_count(creation) != 0)
    throw Hdf5Error("dataset " + name + " is stored in another file");
  return dataset;
}

Handle open_dataset(hid_t parent, const std::string& name, int rank) {
  Handle dataset = open_dataset(parent, name);
  if (static_cast<int>(extents(dataset).size()) != rank)
    throw Hdf5Error("dataset " + name + " does not have " + std::to_string(rank) + " axes");
  return dataset;
}

hsize_t stored_bytes(hid_t dataset) {
  const Handle file(H5Iget_file_id(dataset), H5Fclose, "file");
  hsize_t file_bytes = 0;
  check(H5Fget_filesize(file, &file_bytes), "file size");
  return std::min(H5Dget_storage_size(dataset), file_bytes);
}

void require_stored(hid_t dataset, hsize_t count, const std::string& name) {
  // Deflate compresses at most about 1030:1. A chunk that was never written stores nothing.
  constexpr hsize_t kMaxExpansion = 1100, kFreeEntries = 65536;
  const Handle type(H5Dget_type(dataset), H5Tclose, name);
  const hsize_t entry_bytes = std::max<hsize_t>(H5Tget_size(type), 1);
  if (count > kFreeEntries && (count - kFreeEntries) / kMaxExpansion > stored_bytes(dataset) / entry_bytes)
    throw Hdf5Error("dataset " + name + " declares more entries than it can hold");
}

hsize_t stored_entries(hid_t dataset, std::size_t bytes_per_entry) {
  return std::min(extents(dataset).at(0), stored_bytes(dataset) / bytes_per_entry);
}

std::vector<std::string> read_strings(hid_t parent, const std::string& name, hsize_t count) {
  const Handle dataset = open_dataset(parent, name, 1);
  const Handle type(H5Dget_type(dataset), H5Tclose, name);
  if (H5Tis_variable_str(type) <= 0) throw Hdf5Error("dataset " + name + " does not hold strings");
  std::vector<char*> characters(count);
  if (count == 0) return {};
  require_memory(0);
  const hsize_t first = 0;
  const Handle file(H5Dget_space(dataset), H5Sclose, name);
  check(H5Sselect_hyperslab(file, H5S_SELECT_SET, &first, nullptr, &count, nullptr),
        "dataset " + name + " is too short");
  const Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose, name);
  check(H5Dread(dataset, type, memory, file, H5P_DEFAULT, characters.data()),
        "dataset " + name + " cannot be read");
  std::vector<std::string> texts;
  for (char* text : characters) {
    texts.emplace_back(text ? text : "");
    H5free_memory(text);
  }
  return texts;
}

namespace {

// By index, HDF5 sorts all names for each.
template <class Named>
std::vector<Named> list_attributes(hid_t group, const char* group_name) {
  const auto collect = [](hid_t, const char* name, const H5A_info_t*, void* list) -> herr_t {
    static_cast<std::vector<Named>*>(list)->push_back({name, {}});
    return 0;
  };
  std::vector<Named> all;
  check(H5Aiterate2(group, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &all), group_name);
  return all;
}

}  // namespace

std::vector<NamedText> read_string_attributes(hid_t parent, const char* group_name) {
  const Handle group = open_group(parent, group_name);
  std::vector<NamedText> texts = list_attributes<NamedText>(group, group_name);
  for (auto& [name, text] : texts) text = read_text_attribute(group, name.c_str());
  return texts;
}

std::vector<NamedNumber> read_number_attributes(hid_t parent, const char* group_name) {
  const Handle group = open_group(parent, group_name);
  std::vector<NamedNumber> numbers = list_attributes<NamedNumber>(group, group_name);
  for (auto& [name, number] : numbers) read_attribute(group, name.c_str(), H5T_NATIVE_DOUBLE, &number);
  return numbers;
}

}  // namespace smartsurf::record
