// Bytes of values without pointers.
#pragma once

#include <cstddef>
#include <string>

namespace smartsurf::mesh {

template <typename T>
void append(std::string& bytes, const T* values, std::size_t count) {
  bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

}  // namespace smartsurf::mesh
