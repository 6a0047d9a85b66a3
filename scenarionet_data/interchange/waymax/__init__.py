"""Waymax's ``tf.Example``: scenarios as the Waymo Open Motion Dataset's examples, one TFRecord file each."""
