#include "smartsurf/record/hdf5/Hdf5.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iterator>
#include <new>
#include <utility>

namespace smartsurf::record {
namespace {

// Upper bound of what the library allocates between two calls of require_memory(): metadata, chunks and
// filters.
constexpr std::size_t kLibraryBytes = std::size_t{16} << 20;

constexpr std::pair<std::string_view, char> kEscapes[] = {
    {"%2F", '/'}, {"%00", '\0'}, {"%2E", '.'}, {"%25", '%'}};

// H5E_WALK_UPWARD starts at the innermost error, which is the cause.
herr_t store_innermost_error(unsigned depth, const H5E_error2_t* error, void* text) {
  if (depth == 0 && error->desc) *static_cast<std::string*>(text) = error->desc;
  return 0;
}

// Why the last call failed, as one line; empty if the library does not say. `quoted`: it is the system's own
// text.
std::string take_reason(bool& quoted) {
  quoted = false;
  std::string reason;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, store_innermost_error, &reason);
  H5Eclear2(H5E_DEFAULT);
  for (char& c : reason)
    if (c == '\n') c = ' ';
  // The description of a failed write quotes the system error; keep only that.
  static const std::string kQuote = "error message = '";
  if (const auto quote = reason.find(kQuote); quote != std::string::npos) {
    const auto begin = quote + kQuote.size();
    quoted = true;
    return reason.substr(begin, reason.find('\'', begin) - begin);
  }
  return reason;
}

[[noreturn]] void throw_hdf5_error(const std::string& what) {
  bool quoted = false;
  const std::string reason = take_reason(quoted);
  if (quoted) throw Hdf5Error(reason);
  throw Hdf5Error(reason.empty() ? what : what + " (" + reason + ")");
}

bool has_memory(std::size_t bytes) noexcept {
  void* block = std::malloc(bytes + kLibraryBytes);
  std::free(block);
  return block != nullptr;
}

// The library prints its errors to `stderr` until it is initialised and can be told not to. The descriptor
// stays: a line about memory that ends the process there (Termination.h) is written to it.
class SilentStandardError {
 public:
  SilentStandardError() : nowhere_(std::fopen("/dev/null", "we")) {
    if (nowhere_ != nullptr) saved_ = std::exchange(stderr, nowhere_);
  }
  ~SilentStandardError() {
    if (nowhere_ == nullptr) return;
    stderr = saved_;
    std::fclose(nowhere_);
  }
  SilentStandardError(const SilentStandardError&) = delete;
  SilentStandardError& operator=(const SilentStandardError&) = delete;

 private:
  std::FILE* nowhere_;
  std::FILE* saved_ = nullptr;
};

thread_local bool close_failed = false;
thread_local std::string close_failure;

Handle scalar_space() { return Handle(H5Screate(H5S_SCALAR), H5Sclose, "dataspace"); }

}  // namespace

Handle::Handle(hid_t id, Closer closer, const std::string& what) : id_(id), closer_(closer) {
  if (id < 0) throw_hdf5_error(what);
}

void check(herr_t status, const std::string& what) {
  if (status < 0) throw_hdf5_error(what);
}

void Handle::close() noexcept {
  if ((std::uncaught_exceptions() > 0 && !has_memory(0)) || closer_(id_) >= 0) return;
  close_failed = true;
  try {
    bool quoted = false;
    close_failure = take_reason(quoted);
  } catch (const std::exception&) {  // the failure is known, its reason is not
  }
}

void check_closed() {
  if (!std::exchange(close_failed, false)) return;
  const std::string reason = std::exchange(close_failure, {});
  throw Hdf5Error(reason.empty() ? "an object cannot be closed" : reason);
}

void require_memory(std::size_t bytes) {
  if (!has_memory(bytes)) throw std::bad_alloc();
}

void initialise_library() {
  require_memory(0);
  // First of all calls, or it has no effect. The library's own termination crashes if a file could not be
  // written: the recorders close their files themselves.
  static const bool once = [] {
    const SilentStandardError silent;
    H5dont_atexit();
    // Links to other files: a recording has none, and a hostile one must not make the program open them.
    const bool ready =
        H5Lunregister(H5L_TYPE_EXTERNAL) >= 0 && H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr) >= 0;
    if (!ready) throw std::bad_alloc();  // nothing else fails there
    return true;
  }();
  (void)once;
}

Handle string_type() {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "string type");
  check(H5Tset_size(type, H5T_VARIABLE), "string type");
  check(H5Tset_cset(type, H5T_CSET_UTF8), "string type");
  return type;
}

Handle chunked_properties(const std::vector<hsize_t>& chunk) {
  Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "dataset properties");
  check(H5Pset_chunk(properties, static_cast<int>(chunk.size()), chunk.data()), "chunks");
  check(H5Pset_obj_track_times(properties, false), "dataset properties");
  return properties;
}

Handle create_dataset(hid_t parent, const char* name, hid_t type, hid_t space, hid_t properties) {
  return Handle(H5Dcreate2(parent, name, type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose,
                std::string("dataset ") + name);
}

void write_dataset(hid_t parent, const char* name, std::span<const hsize_t> size, hid_t type,
                   const void* values) {
  const Handle space(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose, name);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, name);
  check(H5Pset_obj_track_times(properties, false), name);
  const Handle dataset = create_dataset(parent, name, type, space, properties);
  check(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), name);
}

Handle create_group(hid_t parent, const char* name) {
  return Handle(H5Gcreate2(parent, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose,
                std::string("group ") + name);
}

std::string link_name(std::string_view name) {
  const auto is_escaped = [&](std::size_t i, const auto& escape) {
    if (name[i] != escape.second) return false;
    if (name[i] == '.') return name.size() == 1;
    return name[i] != '%' || std::ranges::any_of(kEscapes, [&](const auto& other) {
             return name.substr(i).starts_with(other.first);
           });
  };
  std::string link;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const auto escape = std::ranges::find_if(kEscapes, [&](const auto& each) { return is_escaped(i, each); });
    if (escape == std::end(kEscapes))
      link += name[i];
    else
      link += escape->first;
  }
  return link;
}

std::string name_of_link(std::string_view link) {
  std::string name;
  while (!link.empty()) {
    const auto escape =
        std::ranges::find_if(kEscapes, [&](const auto& each) { return link.starts_with(each.first); });
    const bool is_escape = escape != std::end(kEscapes);
    name += is_escape ? escape->second : link.front();
    link.remove_prefix(is_escape ? escape->first.size() : 1);
  }
  return name;
}

void write_attribute(hid_t object, const char* name, const std::string& text) {
  const Handle type = string_type(), space = scalar_space();
  const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
  const char* characters = text.c_str();
  check(H5Awrite(attribute, type, &characters), name);
}

void write_attribute(hid_t object, const char* name, hid_t type, const void* values, hsize_t count) {
  const Handle space =
      count == 1 ? scalar_space() : Handle(H5Screate_simple(1, &count, nullptr), H5Sclose, name);
  const Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
  check(H5Awrite(attribute, type, values), name);
}

void write_attribute(hid_t object, const char* name, double value) {
  write_attribute(object, name, H5T_NATIVE_DOUBLE, &value);
}

void write_attribute(hid_t object, const char* name, std::uint64_t value) {
  write_attribute(object, name, H5T_NATIVE_UINT64, &value);
}

bool has_link(hid_t parent, const char* name) {
  const htri_t exists = H5Lexists(parent, name, H5P_DEFAULT);
  check(exists, std::string(name) + " cannot be looked up");
  return exists > 0;
}

bool has_attribute(hid_t object, const char* name) {
  const htri_t exists = H5Aexists(object, name);
  check(exists, std::string("attribute ") + name + " cannot be looked up");
  return exists > 0;
}

std::string read_text_attribute(hid_t object, const char* name) {
  const std::string what = std::string("attribute ") + name;
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, what);
  const Handle space(H5Aget_space(attribute), H5Sclose, what);
  const Handle stored(H5Aget_type(attribute), H5Tclose, what);
  if (H5Sget_simple_extent_npoints(space) != 1 || H5Tis_variable_str(stored) <= 0)
    throw Hdf5Error(what + " (is not a single string)");
  char* characters = nullptr;
  check(H5Aread(attribute, stored, &characters), what);
  std::string text = characters ? characters : "";
  H5free_memory(characters);
  return text;
}

void read_attribute(hid_t object, const char* name, hid_t type, void* values, hsize_t count) {
  const std::string what = std::string("attribute ") + name;
  const Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, what);
  const Handle space(H5Aget_space(attribute), H5Sclose, what);
  if (H5Sget_simple_extent_npoints(space) != static_cast<hssize_t>(count))
    throw Hdf5Error(what + " (does not hold " + std::to_string(count) + " numbers)");
  check(H5Aread(attribute, type, values), what);
}

std::vector<hsize_t> extents(hid_t dataset) {
  const Handle space(H5Dget_space(dataset), H5Sclose, "dataspace");
  const int rank = H5Sget_simple_extent_ndims(space);
  check(rank, "dataspace");
  std::vector<hsize_t> sizes(rank);
  check(H5Sget_simple_extent_dims(space, sizes.data(), nullptr), "dataspace");
  return sizes;
}

}  // namespace smartsurf::record
