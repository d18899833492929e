// Bytes as text in a page. Internal to this module.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace smartsurf::web {

std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace smartsurf::web
