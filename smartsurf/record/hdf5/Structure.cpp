#include "smartsurf/record/hdf5/Structure.h"

#include <exception>
#include <set>
#include <string>

#include "smartsurf/record/hdf5/Hdf5Reading.h"

namespace smartsurf::record {
namespace {

class Walk {
 public:
  explicit Walk(std::vector<StoredDataset>& datasets) : datasets_(datasets) {}

  // Each object is opened in its group: a path is searched for from the root on.
  void enter(hid_t group, const std::string& path, int depth) {
    const std::string place = path.empty() ? "/" : path;
    H5G_info_t group_info;
    check(H5Gget_info(group, &group_info), place);
    if (group_info.nlinks > kMaxObjects - objects_)
      throw Hdf5Error("has more than " + std::to_string(kMaxObjects) + " objects, the most that are read");
    objects_ += group_info.nlinks;
    for (const std::string& name : names(group, place)) visit(group, path + '/' + name, name, depth);
  }

 private:
  static std::vector<std::string> names(hid_t group, const std::string& place) {
    const auto collect = [](hid_t, const char* name, const H5L_info_t* link, void* list) -> herr_t {
      try {
        if (link->type == H5L_TYPE_HARD) static_cast<std::vector<std::string>*>(list)->emplace_back(name);
        return 0;
      } catch (const std::exception&) {  // no memory
        return -1;
      }
    };
    std::vector<std::string> found;
    check(H5Literate(group, H5_INDEX_NAME, H5_ITER_INC, nullptr, collect, &found), place);
    return found;
  }

  void visit(hid_t group, const std::string& path, const std::string& name, int depth) {
    H5O_info_t info;
    check(H5Oget_info_by_name2(group, name.c_str(), &info, H5O_INFO_BASIC | H5O_INFO_NUM_ATTRS, H5P_DEFAULT),
          path);
    if (info.num_attrs > kMaxAttributes)
      throw Hdf5Error(path + " has " + std::to_string(info.num_attrs) + " attributes; at most " +
                      std::to_string(kMaxAttributes) + " are read");
    if (info.rc > 1 && !seen_.insert(info.addr).second) return;
    if (info.type == H5O_TYPE_DATASET) {
      const Handle dataset(H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose, path);
      datasets_.push_back({path, extents(dataset)});
    } else if (info.type == H5O_TYPE_GROUP) {
      if (depth == kMaxDepth)
        throw Hdf5Error("has groups in more than " + std::to_string(kMaxDepth) +
                        " levels, the most that are read");
      enter(open_group(group, name.c_str()), path, depth + 1);
    }
  }

  std::vector<StoredDataset>& datasets_;
  std::set<haddr_t> seen_;
  hsize_t objects_ = 0;
};

}  // namespace

std::vector<StoredDataset> list_structure(hid_t file) {
  std::vector<StoredDataset> datasets;
  Walk(datasets).enter(open_group(file, "/"), "", 0);
  return datasets;
}

}  // namespace smartsurf::record
