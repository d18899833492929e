// A forest of sets of indices: each index has a parent, and a root is its own.
#pragma once

namespace common {

// The root of i; the path to it is halved. `parent` is a vector or a map of indices.
template <class Parents, class Index>
Index find_root(Parents& parent, Index i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

}  // namespace common
