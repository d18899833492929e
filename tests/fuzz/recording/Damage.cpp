#include "tests/fuzz/recording/Damage.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string_view>

#include "smartsurf/run/Run.h"

namespace fuzz {
namespace {

using smartsurf::run::Run;
using smartsurf::run::RunOptions;
namespace fs = std::filesystem;

// What a recording says in words.
constexpr std::array<std::string_view, 16> kTexts = {"",
                                                     "sphere",
                                                     "solid",
                                                     "box",
                                                     "cone",
                                                     "pin",
                                                     "skin",
                                                     "kinematic",
                                                     "script",
                                                     "controller",
                                                     "bullet",
                                                     "nan",
                                                     "/etc/passwd",
                                                     "surface{rows=1,columns=1}",
                                                     "\x1b[2J\n\t\xff",
                                                     "smartsurf-recording"};

// What the library can change, in the order of a visit.
struct Parts {
  struct Attribute {
    std::string object, name;
    bool is_text;
  };
  std::vector<Attribute> attributes;
  std::vector<std::string> groups, datasets;
};

herr_t note_attribute(hid_t object, const char* name, const H5A_info_t*, void* data) {
  auto& parts = *static_cast<std::pair<Parts*, std::string>*>(data);
  const hid_t attribute = H5Aopen(object, name, H5P_DEFAULT), type = H5Aget_type(attribute);
  parts.first->attributes.push_back({parts.second, name, H5Tget_class(type) == H5T_STRING});
  H5Tclose(type), H5Aclose(attribute);
  return 0;
}

herr_t note_object(hid_t root, const char* name, const H5O_info_t* info, void* data) {
  auto* const parts = static_cast<Parts*>(data);
  if (std::strcmp(name, ".") != 0)
    (info->type == H5O_TYPE_DATASET ? parts->datasets : parts->groups).emplace_back(name);
  std::pair<Parts*, std::string> owner{parts, name};
  const hid_t object = H5Oopen(root, name, H5P_DEFAULT);
  H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, nullptr, note_attribute, &owner);
  H5Oclose(object);
  return 0;
}

Parts parts_of(hid_t file) {
  Parts parts;
  H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, note_object, &parts, H5O_INFO_BASIC);
  return parts;
}

std::string text_of(const Change& change) {
  if (change.at % (kTexts.size() + 1) < kTexts.size())
    return std::string(kTexts[change.at % (kTexts.size() + 1)]);
  std::string text(sizeof change.value, '\0');
  std::memcpy(text.data(), &change.value, text.size());
  return text;
}

void write_text(hid_t object, const Change& change, bool is_attribute) {
  const hid_t type = is_attribute ? H5Aget_type(object) : H5Dget_type(object),
              space = is_attribute ? H5Aget_space(object) : H5Dget_space(object);
  const std::string text = text_of(change);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  if (H5Tis_variable_str(type) > 0 && count > 0 && count < 1000) {
    const std::vector<const char*> texts(static_cast<std::size_t>(count), text.c_str());
    if (is_attribute)
      H5Awrite(object, type, texts.data());
    else
      H5Dwrite(object, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, texts.data());
  }
  H5Sclose(space), H5Tclose(type);
}

void write_numbers(hid_t attribute, const Change& change) {
  const hid_t space = H5Aget_space(attribute);
  std::vector<std::uint64_t> values(
      static_cast<std::size_t>(std::clamp<hssize_t>(H5Sget_simple_extent_npoints(space), 1, 1000)),
      change.value);
  H5Awrite(attribute, change.at % 2 == 0 ? H5T_NATIVE_DOUBLE : H5T_NATIVE_UINT64, values.data());
  H5Sclose(space);
}

void write_entry(hid_t dataset, const Change& change) {
  const hid_t space = H5Dget_space(dataset), type = H5Dget_type(dataset), memory = H5Screate(H5S_SCALAR);
  hsize_t size[H5S_MAX_RANK], at[H5S_MAX_RANK], rest = change.at;
  const int rank = H5Sget_simple_extent_dims(space, size, nullptr);
  bool has_entries = rank > 0 && H5Tget_class(type) != H5T_STRING && H5Tget_size(type) <= sizeof change.value;
  for (int axis = rank - 1; axis >= 0 && (has_entries = has_entries && size[axis] > 0); --axis)
    at[axis] = rest % size[axis], rest /= size[axis];
  if (has_entries && H5Sselect_elements(space, H5S_SELECT_SET, 1, at) >= 0)
    H5Dwrite(dataset, type, memory, space, H5P_DEFAULT, &change.value);
  H5Sclose(memory), H5Tclose(type), H5Sclose(space);
}

void write_extent(hid_t dataset, const Change& change) {
  const hid_t space = H5Dget_space(dataset);
  hsize_t size[H5S_MAX_RANK];
  const int rank = H5Sget_simple_extent_dims(space, size, nullptr);
  // The library looks for every chunk that a dataset loses.
  constexpr hsize_t kMaxLost = 1 << 20;
  if (rank > 0 && size[change.at % rank] < kMaxLost) {
    size[change.at % rank] = change.value;
    H5Dset_extent(dataset, size);
  }
  H5Sclose(space);
}

// Type, rank and extents of `value`: 4 bits of type, 4 of rank, then a byte for each extent: below 128 that
// extent, above a power of two.
void replace_shape(hid_t file, const Parts& parts, const Change& change) {
  static constexpr int kTypes = 6;
  const std::array<hid_t, kTypes> types = {H5T_NATIVE_FLOAT,  H5T_NATIVE_DOUBLE, H5T_NATIVE_UINT8,
                                           H5T_NATIVE_UINT64, H5T_NATIVE_INT32,  H5T_C_S1};
  std::uint64_t rest = change.value;
  const hid_t type = types[(rest & 15U) % kTypes];
  const int rank = static_cast<int>((rest >> 4U & 15U) % 5);
  hsize_t size[5] = {};
  for (int axis = 0; axis < rank; ++axis) {
    const std::uint64_t byte = (rest >>= 8U) & 255U;
    size[axis] = byte < 128 ? byte : std::uint64_t{1} << ((byte - 128) % 62);
  }
  const hid_t space = H5Screate_simple(rank, size, nullptr);
  const std::size_t all = parts.datasets.size() + parts.attributes.size(),
                    which = all > 0 ? change.which % all : 0;
  if (all == 0 || space < 0) {
  } else if (which < parts.datasets.size()) {
    const std::string& name = parts.datasets[which];
    if (H5Ldelete(file, name.c_str(), H5P_DEFAULT) >= 0)
      H5Dclose(H5Dcreate2(file, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  } else if (H5Sget_simple_extent_npoints(space) < 1000) {
    const Parts::Attribute& of = parts.attributes[which - parts.datasets.size()];
    const hid_t object = H5Oopen(file, of.object.c_str(), H5P_DEFAULT);
    H5Adelete(object, of.name.c_str());
    H5Aclose(H5Acreate2(object, of.name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT));
    H5Oclose(object);
  }
  H5Sclose(space);
}

void remove_part(hid_t file, const Parts& parts, const Change& change) {
  std::size_t which = change.at % (parts.attributes.size() + parts.datasets.size() + parts.groups.size());
  if (which < parts.attributes.size()) {
    const Parts::Attribute& of = parts.attributes[which];
    H5Adelete_by_name(file, of.object.c_str(), of.name.c_str(), H5P_DEFAULT);
    return;
  }
  which -= parts.attributes.size();
  const std::string& name =
      which < parts.datasets.size() ? parts.datasets[which] : parts.groups[which - parts.datasets.size()];
  H5Ldelete(file, name.c_str(), H5P_DEFAULT);
}

void apply_in_library(hid_t file, const Change& change) {
  const Parts parts = parts_of(file);
  const auto attributes = [&](bool is_text) {
    std::vector<Parts::Attribute> found;
    std::ranges::copy_if(parts.attributes, std::back_inserter(found),
                         [&](const auto& attribute) { return attribute.is_text == is_text; });
    return found;
  };
  const auto on_attribute = [&](const Parts::Attribute& of, auto action) {
    const hid_t attribute =
        H5Aopen_by_name(file, of.object.c_str(), of.name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
    action(attribute, change);
    H5Aclose(attribute);
  };
  const auto on_dataset = [&](const std::string& name, auto action) {
    const hid_t dataset = H5Dopen2(file, name.c_str(), H5P_DEFAULT);
    action(dataset, change);
    H5Dclose(dataset);
  };
  switch (change.kind) {
    case Change::kNumber:
      if (const auto found = attributes(false); !found.empty())
        on_attribute(found[change.which % found.size()], write_numbers);
      break;
    case Change::kText: {
      const auto found = attributes(true);
      const std::size_t which = change.which % (found.size() + parts.datasets.size() + 1);
      if (which < found.size())
        on_attribute(found[which], [](hid_t a, const Change& c) { write_text(a, c, true); });
      else if (which - found.size() < parts.datasets.size())
        on_dataset(parts.datasets[which - found.size()],
                   [](hid_t d, const Change& c) { write_text(d, c, false); });
      break;
    }
    case Change::kEntry:
      if (!parts.datasets.empty())
        on_dataset(parts.datasets[change.which % parts.datasets.size()], write_entry);
      break;
    case Change::kExtent:
      if (!parts.datasets.empty())
        on_dataset(parts.datasets[change.which % parts.datasets.size()], write_extent);
      break;
    case Change::kShape:
      replace_shape(file, parts, change);
      break;
    default:
      if (!parts.attributes.empty()) remove_part(file, parts, change);
  }
}

bool is_in_library(const Change& change) { return change.kind < Change::kReference; }

using Bytes = std::vector<char>;

std::vector<std::size_t> all_of(const Bytes& bytes, std::string_view mark) {
  std::vector<std::size_t> found;
  for (auto at = bytes.begin(); (at = std::search(at, bytes.end(), mark.begin(), mark.end())) != bytes.end();
       ++at)
    found.push_back(static_cast<std::size_t>(at - bytes.begin()));
  return found;
}

// References to the global heaps: an address of one follows the text's length.
std::vector<std::size_t> references_in(const Bytes& bytes) {
  const std::vector<std::size_t> heaps = all_of(bytes, "GCOL");
  std::vector<std::size_t> found;
  for (std::size_t at = 4; at + sizeof(std::uint64_t) <= bytes.size(); ++at) {
    std::uint64_t address = 0;
    std::memcpy(&address, &bytes[at], sizeof address);
    if (address > 0 && std::ranges::find(heaps, address) != heaps.end()) found.push_back(at - 4);
  }
  return found;
}

// Marked structures, and headers of objects, which name their attributes.
std::vector<std::size_t> structures_in(const Bytes& bytes) {
  std::vector<std::size_t> found = {0};
  for (const std::string_view mark : {"GCOL", "HEAP", "SNOD", "TREE", "unit", "channels", "format", "rows"})
    for (const std::size_t at : all_of(bytes, mark))
      found.push_back(mark.front() < 'a' ? at : at - std::min<std::size_t>(at, 64));
  return found;
}

void overwrite(Bytes& bytes, std::size_t at, const Change& change, std::size_t count) {
  if (at < bytes.size()) std::memcpy(&bytes[at], &change.value, std::min(count, bytes.size() - at));
}

void apply_to_bytes(Bytes& bytes, const Change& change) {
  if (bytes.empty()) return;
  const std::size_t position = (change.which * std::size_t{65536} + change.at) % bytes.size();
  switch (change.kind) {
    case Change::kReference:
      if (const auto found = references_in(bytes); !found.empty())
        overwrite(bytes, found[change.which % found.size()] + change.at % 16U, change, 4);
      break;
    case Change::kStructure: {
      const auto found = structures_in(bytes);
      overwrite(bytes, found[change.which % found.size()] + change.at % 512U, change,
                1 + change.at / 512U % 8);
      break;
    }
    case Change::kCut:
      bytes.resize(position);
      break;
    default:
      overwrite(bytes, position, change, 1 + change.which / 32U);
  }
}

Bytes read_bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(in), {});
}

}  // namespace

std::vector<Change> read_changes(std::span<const std::uint8_t> bytes) {
  std::vector<Change> changes;
  for (; bytes.size() >= kChangeBytes && changes.size() < kMaxChanges; bytes = bytes.subspan(kChangeBytes)) {
    Change change{static_cast<Change::Kind>(bytes[0] % Change::kKinds), bytes[1], 0, 0};
    std::memcpy(&change.at, &bytes[2], sizeof change.at);
    std::memcpy(&change.value, &bytes[4], sizeof change.value);
    changes.push_back(change);
  }
  return changes;
}

void record_experiment(const std::string& script, const fs::path& recording) {
  RunOptions options;
  options.experiment = recording.string() + ".lua";
  std::ofstream(options.experiment) << script;
  options.no_controller = true;
  options.ticks = 12;
  options.recording_files = {recording.string()};
  const std::atomic<bool> stop{false};
  if (Run(options, stop, Run::load(options)).execute() != 0)
    throw std::runtime_error(recording.string() + ": cannot be recorded");
}

void write_damaged(const fs::path& recording, std::span<const Change> changes, const fs::path& to) {
  fs::copy_file(recording, to, fs::copy_options::overwrite_existing);
  if (std::ranges::any_of(changes, is_in_library)) {
    const hid_t file = H5Fopen(to.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    for (const Change& change : changes)
      if (is_in_library(change)) apply_in_library(file, change);
    H5Fclose(file);
  }
  Bytes bytes = read_bytes(to);
  for (const Change& change : changes)
    if (!is_in_library(change)) apply_to_bytes(bytes, change);
  std::ofstream(to, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace fuzz
