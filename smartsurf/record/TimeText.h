#pragma once

#include <string>

namespace smartsurf::record {

// A time in seconds to four significant digits and one decimal at least: "1234.5", "45.23", "30",
// "0.0009766".
std::string time_text(double time_s);

}  // namespace smartsurf::record
