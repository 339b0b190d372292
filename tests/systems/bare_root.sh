# To be sourced, as root: makes a bare Debian in $root, which goes when the shell exits, and `within COMMAND...`.
#   make_bare_root SUITE
root=$(mktemp -d /var/tmp/xraycast-bare.XXXXXX)
clean_bare_root() {
  for folder in proc sys dev; do mountpoint -q "$root/$folder" && umount -lR "$root/$folder"; done
  rm -rf --one-file-system "$root"
}
trap clean_bare_root EXIT

within() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive "$@"; }

make_bare_root() {
  debootstrap --variant=minbase "$1" "$root" >/dev/null
  mount -t proc proc "$root/proc"
  mount --rbind /sys "$root/sys"
  mount --make-rslave "$root/sys"
  mount --rbind /dev "$root/dev"
  mount --make-rslave "$root/dev"
}

install_within() { within bash -c "apt-get update -qq && apt-get install -y -qq --no-install-recommends $*" >/dev/null 2>&1; }
