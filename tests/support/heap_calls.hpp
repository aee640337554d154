#pragma once
// Counts a thread's calls of malloc and its kin, which this header interposes: include it in one source file of a
// test's binary. Eigen's own guard sees only Eigen, and is off in release builds. Not under sanitizers, which own
// malloc.
#include <cstddef>

namespace stance::test {
/// Of this thread since its start: malloc, calloc, realloc, aligned_alloc, posix_memalign and free.
inline constinit thread_local long heap_calls = 0;
}  // namespace stance::test

// glibc's own entry points, to which the interposed ones pass on.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* block);

void* malloc(std::size_t size) noexcept {
  ++stance::test::heap_calls;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  ++stance::test::heap_calls;
  return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
  ++stance::test::heap_calls;
  return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++stance::test::heap_calls;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size) noexcept {
  ++stance::test::heap_calls;
  *block = __libc_memalign(alignment, size);
  return 0;
}
void free(void* block) noexcept {
  ++stance::test::heap_calls;
  __libc_free(block);
}
}
