/* Loaded before the C library, it plays a disk that is full: the files below the folder FULL_DISK take no
 * more than FULL_DISK_B bytes in all. With FULL_DISK_LATE they take everything until they are synced, as
 * where a file system gives out its blocks late. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_llong used_B;

static int is_on_disk(int file) {
  const char* disk = getenv("FULL_DISK");
  char link[64], path[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const ssize_t length = disk ? readlink(link, path, sizeof path - 1) : -1;
  if (length < 0) return 0;
  path[length] = 0;
  return strncmp(path, disk, strlen(disk)) == 0;
}

/* Whether the disk takes so many bytes more; errno is set where it does not. */
static int takes(int file, size_t count) {
  if (!is_on_disk(file) || getenv("FULL_DISK_LATE")) return 1;
  const char* size = getenv("FULL_DISK_B");
  if (atomic_fetch_add(&used_B, (long long)count) + (long long)count <= (size ? atoll(size) : 0)) return 1;
  errno = ENOSPC;
  return 0;
}

static int is_synced(int file) {
  if (!is_on_disk(file) || !getenv("FULL_DISK_LATE")) return 1;
  errno = ENOSPC;
  return 0;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int file, const void* bytes, size_t count) {
  return takes(file, count) ? NEXT(write)(file, bytes, count) : -1;
}

ssize_t pwrite(int file, const void* bytes, size_t count, off_t at) {
  return takes(file, count) ? NEXT(pwrite)(file, bytes, count, at) : -1;
}

ssize_t writev(int file, const struct iovec* parts, int count) {
  size_t sum = 0;
  for (int i = 0; i < count; ++i) sum += parts[i].iov_len;
  return takes(file, sum) ? NEXT(writev)(file, parts, count) : -1;
}

/* The C library's own calls of write cannot be intercepted. */
size_t fwrite(const void* bytes, size_t size, size_t count, FILE* stream) {
  return takes(fileno(stream), size * count) ? NEXT(fwrite)(bytes, size, count, stream) : 0;
}

int fsync(int file) { return is_synced(file) ? NEXT(fsync)(file) : -1; }

int fdatasync(int file) { return is_synced(file) ? NEXT(fdatasync)(file) : -1; }
