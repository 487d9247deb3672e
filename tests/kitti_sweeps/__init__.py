"""KITTI drive 0005 as sweeps and poses, read where the recorded drives are."""
