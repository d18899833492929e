// Resources that a forked child must not use.
#pragma once

namespace smartsurf::record {

class Owner {
 public:
  Owner() noexcept;
  // True in a process that was forked from the one that made the object.
  bool is_child() const noexcept;

 private:
  unsigned forks_;
};

// In a child of fork() the descriptor leads to /dev/null: nothing that the child writes reaches the file,
// also by a library at exit, and the child holds none of the file's locks. Destroy it before closing the
// descriptor.
class OwnedDescriptor {
 public:
  explicit OwnedDescriptor(int descriptor);
  ~OwnedDescriptor();
  OwnedDescriptor(const OwnedDescriptor&) = delete;
  OwnedDescriptor& operator=(const OwnedDescriptor&) = delete;

 private:
  int descriptor_;
};

}  // namespace smartsurf::record
