// What a file contains, within limits that recordings keep: HDF5's own means take time that grows with the
// square of the number of attributes and with the cube of the depth. Internal to this module.
#pragma once

#include <string>
#include <vector>

#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

inline constexpr int kMaxDepth = 16;              // of groups
inline constexpr hsize_t kMaxObjects = 200'000;   // groups, datasets and links
inline constexpr hsize_t kMaxAttributes = 8'000;  // of one object

struct StoredDataset {
  std::string name;  // its path, beginning with '/'
  std::vector<hsize_t> extents;
};

// The datasets, groups in pre-order, names ascending; one with several names under the first. Links to other
// places are not followed. Throws Hdf5Error where a limit is exceeded.
std::vector<StoredDataset> list_structure(hid_t file);

}  // namespace smartsurf::record
