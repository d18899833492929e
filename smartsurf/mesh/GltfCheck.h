// Finds what the importer of glTF files would read wrongly.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace smartsurf::mesh {

// Throws scene::InputError if the file is glTF and needs an extension that changes geometry or has positions
// that are not 32-bit floats. Leaves other errors to the importer.
void check_gltf(const std::filesystem::path& file);

// The file name that a URI of glTF, which is percent-encoded, stands for.
std::string decode_uri(std::string_view uri);

}  // namespace smartsurf::mesh
