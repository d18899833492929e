// An invalid input, or a resource that the system refuses: one line that names the file, field and value and
// says what would be right. Programs print what() and exit with ExitStatus::kUserError.
#pragma once

#include <stdexcept>

namespace common {

class UserError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace common
