"""What is missing in lane changing: opportunities, the chance that they are taken, and what else it depends on."""
